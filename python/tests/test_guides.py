"""Guides that say what to measure next."""
import threading
import unittest

import cv2
import numpy as np

import alidade as al
from common import BOARD, TRUE_CAMERA, InFolder, board_corners, command


class Capture(InFolder):
    def test_who_follows_the_outline_comes_to_the_goal(self):
        guide = al.CaptureGuide(BOARD, until_px=1.0, is_video=False)
        guide.push_corners(np.full((54, 2), np.nan), TRUE_CAMERA.size, 0.0)
        self.assertEqual(guide.next.rotation.shape, (3, 3))
        random, kept = np.random.default_rng(2), []
        for t in range(1, 40):
            if guide.is_at_goal:
                break
            asked = guide.next
            corners = TRUE_CAMERA.project(BOARD.points @ asked.rotation.T + asked.translation_m)
            look = guide.push_corners(corners + random.normal(0, 0.05, corners.shape), TRUE_CAMERA.size, 10.0 * t)
            self.assertEqual(look.corners.shape, (np.isfinite(corners[:, 0]).sum(), 2))
            if look.taken:
                self.assertIsNone(look.earlier_t_s)
                kept.append(corners)
        state = guide.state
        self.assertTrue(state.is_at_goal, state)
        self.assertEqual((state.photos, guide.photos), (len(kept), len(kept)))
        self.assertLess(state.worst_3sigma_px, 1.0)
        self.assertLess(abs(state.camera.fx - TRUE_CAMERA.fx), 4 * state.camera.sigma.fx)
        guide.forget(0)
        self.assertEqual(guide.photos, len(kept) - 1)
        again = guide.push_corners(kept[-1], TRUE_CAMERA.size, 1000.0)
        self.assertEqual((again.status, again.taken), ("same_pose", False))

    def test_images_are_judged_as_the_command_judges_them(self):
        photos = self.folder / "photos"
        done = command("simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "9", "--size", "640x480", "--out",
                       photos, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = command("calibrate", "--live", "--no-page", "--wait", "0.3", "--from", photos, "--board", "9x6", "--square", "0.025",
                       "--until", "5px", "--out", self.folder / "kept", "--quiet")
        kept = [cv2.imread(str(file), -1) for file in sorted((self.folder / "kept" / "photos").glob("*.png"))]
        self.assertGreaterEqual(len(kept), 3, done.stderr)
        guide = al.CaptureGuide(BOARD, until_px=5.0, is_video=False)
        taken = []
        for i, file in enumerate(sorted(photos.glob("*.png"))):
            image = cv2.imread(str(file), -1)
            look = guide.push(image, 0.2 * (i + 1))
            if look.taken:
                taken.append(look.image)
            if guide.is_at_goal:
                break
        # the command asks the whole job before it ends, and goes on where that disagrees
        for ours, theirs in zip(taken, kept):
            np.testing.assert_array_equal(ours, theirs)
        self.assertEqual(guide.push(np.zeros((480, 640), np.uint8), 99.0).status, "nothing")
        with self.assertWarns(DeprecationWarning):  # former names
            look = guide.push(picture=np.ones((480, 640), np.uint8), t_s=100.0)
        self.assertEqual((look.sight, look.picture), (look.status, look.image))
        with self.assertRaises(TypeError):
            guide.push(np.ones((480, 640), np.uint8), t_s=101.0, picture=None)

    def test_an_image_that_was_shown_before_is_handed_back(self):
        photos = self.folder / "shown"
        done = command("simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "6", "--size", "640x480", "--out",
                       photos, "--quiet", "--seed", "4")
        self.assertEqual(done.returncode, 0, done.stderr)
        images = {float(i): cv2.imread(str(file), -1) for i, file in enumerate(sorted(photos.glob("*.png")))}
        guide, earlier = al.CaptureGuide(BOARD, until_px=0.01, is_video=False), 0
        for t in range(60):  # the same again and again: what was not taken at once is taken at last
            look = guide.push(images[t % 6] + np.uint8(t % 2), float(t))
            if look.taken and look.earlier_t_s is not None:
                earlier += 1
                shown = int(look.earlier_t_s)
                self.assertLess(shown, t)
                np.testing.assert_array_equal(look.image, images[shown % 6] + np.uint8(shown % 2))
        self.assertGreaterEqual(guide.photos, 4)
        self.assertGreaterEqual(earlier, 1)

    def test_wrong_input_is_one_clear_line(self):
        guide = al.CaptureGuide(BOARD)
        for wrong in (lambda: al.CaptureGuide("9x6"), lambda: al.CaptureGuide(BOARD, until_px=0.0),
                      lambda: al.CaptureGuide(BOARD, model="round"), lambda: al.CaptureGuide(BOARD, colour=1),
                      lambda: guide.push(np.zeros((4, 4)), 0.0), lambda: guide.push(np.zeros((0, 4), np.uint8), 0.0),
                      lambda: guide.push(np.zeros((4, 4), np.uint8), np.nan), lambda: guide.forget(0), lambda: guide.forget(-1),
                      lambda: guide.push_corners(np.zeros((5, 2)), (640, 480), 0.0),
                      lambda: guide.push_corners(np.full((54, 2), np.inf), (640, 480), 0.0),
                      lambda: guide.push_corners(np.zeros((54, 2)), (0, 480), 0.0)):
            with self.assertRaises(ValueError) as caught:
                wrong()
            self.assertNotIn("\n", str(caught.exception))

    def test_threads_share_a_guide(self):
        guide, corners = al.CaptureGuide(BOARD, is_video=False, until_px=0.01), board_corners(num_views=8)

        def work(i):
            for t in range(4):
                guide.push_corners(corners[(i + t) % 8], TRUE_CAMERA.size, 1.0)
                guide.state

        threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        self.assertLessEqual(1, guide.photos)
        self.assertLessEqual(guide.photos, 8)


class Shots(unittest.TestCase):
    def test_guided_shots_find_the_beam(self):
        origin, direction = np.array([0.06, -0.02, 0.01]), np.array([0.03, -0.02, 1.0])
        direction /= np.linalg.norm(direction)
        board = al.Board("9x6", square_m=0.04)
        guide = al.ShotGuide(TRUE_CAMERA, board, sigma_range_m=0.001)
        self.assertIn("m away", guide.state.words)
        random = np.random.default_rng(1)
        middle = board.points.mean(axis=0)
        start = [(0.7, 0.5, 0.0), (1.4, 0.0, 0.5), (2.2, -0.5, 0.0), (1.0, 0.0, -0.5)]
        for i in range(10):
            now = guide.state
            if now.next is not None:
                R, t = now.next.rotation, now.next.translation_m
            else:
                z, rx, ry = start[i % 4]
                R = cv2.Rodrigues(np.array([rx, ry, 0.0]))[0]
                t = np.array([0.0, 0.0, z]) - R @ middle
            n = R[:, 2]
            reading = n @ (t - origin) / (n @ direction) + random.normal(0, 0.001)
            corners = TRUE_CAMERA.project(board.points @ R.T + t)
            spot = TRUE_CAMERA.project(origin + reading * direction)
            guide.push(reading, spot=spot, corners=corners + random.normal(0, 0.1, corners.shape))
        state = guide.state
        self.assertTrue(state.has_beam, state.sentence)
        self.assertEqual(state.shots, 10)
        self.assertLess(np.linalg.norm(state.origin_m - origin), 5 * state.sigma_origin_m + 1e-4)
        self.assertLess(np.linalg.norm(state.direction - direction), 0.01)
        guide.undo()
        self.assertEqual(guide.state.shots, 9)

    def test_wrong_input_is_one_clear_line(self):
        guide = al.ShotGuide(TRUE_CAMERA)
        for wrong in (lambda: al.ShotGuide("absent.yaml"), lambda: al.ShotGuide(TRUE_CAMERA, "9x6"),
                      lambda: al.ShotGuide(TRUE_CAMERA, max_tilt_deg=200.0), lambda: guide.push(np.nan),
                      lambda: guide.push("far"), lambda: guide.push(1.0, spot=[1.0]), lambda: guide.push(1.0, plane=[0, 0, 1]),
                      lambda: guide.push(1.0, corners=np.zeros((54, 2)))):
            with self.assertRaises(ValueError) as caught:
                wrong()
            self.assertNotIn("\n", str(caught.exception))
        self.assertEqual(guide.state.shots, 0)


class Views(unittest.TestCase):
    def test_guided_views_find_the_axes(self):
        rng, board = np.random.default_rng(3), al.Board("9x6", square_m=0.025)
        guide = al.ViewGuide({1: TRUE_CAMERA}, board, sigma_px=0.1, sigma_angle_rad=1e-4)
        self.assertIn("position 1", guide.state.words)
        mount = cv2.Rodrigues(np.array([0.02, -0.03, 0.01]))[0]
        to_camera = np.array([0.02, -0.01, 0.05])

        def camera_from_world(pan, tilt):  # pan > 0 turns left, tilt > 0 up; y points down
            turned = cv2.Rodrigues(np.array([-tilt, 0.0, 0.0]))[0] @ cv2.Rodrigues(np.array([0.0, pan, 0.0]))[0]
            return mount @ turned, mount @ -to_camera

        def look(pan_tilt, R_world, t_world, number):
            R, t = camera_from_world(*pan_tilt)
            px = TRUE_CAMERA.project(board.points @ (R @ R_world).T + (R @ t_world + t))
            inside = (px > 1).all(axis=1) & (px[:, 0] < TRUE_CAMERA.size[0] - 2) & (px[:, 1] < TRUE_CAMERA.size[1] - 2)
            px[~inside] = np.nan
            return guide.push(1, np.array(pan_tilt) + rng.normal(0, 1e-4, 2), px + rng.normal(0, 0.1, px.shape), board=number)

        places = {1: (np.eye(3), np.array([-0.1, -0.06, 0.6])), 2: (cv2.Rodrigues(np.array([0.4, 0.2, 0]))[0], np.array([0.0, -0.1, 0.9]))}
        for number, (R, t) in places.items():
            for pan_tilt in ((0, 0), (0.1, 0.08), (-0.1, -0.08), (0.1, -0.06), (-0.08, 0.07)):
                state = look(pan_tilt, R, t, number)
        self.assertTrue(state.has_rig, state.sentence)
        first = state
        for _ in range(4):
            asked = guide.state.next
            self.assertEqual(asked.outline.shape[1], 2)
            if asked.is_new_position:
                R, t = camera_from_world(*asked.pan_tilt_rad)
                places[asked.board] = (R.T @ asked.rotation, R.T @ (asked.translation_m - t))
            state = look(asked.pan_tilt_rad, *places[asked.board], asked.board)
        self.assertLess(state.sigma_rad * state.sigma_m, 0.6 * first.sigma_rad * first.sigma_m)
        guide.undo()
        self.assertEqual(guide.state.views, 13)

    def test_wrong_input_is_one_clear_line(self):
        board = al.Board("9x6", square_m=0.025)
        guide = al.ViewGuide({1: TRUE_CAMERA}, board)
        corners = np.full((54, 2), 100.0)
        for wrong in (lambda: al.ViewGuide({}, board), lambda: al.ViewGuide(TRUE_CAMERA, board), lambda: al.ViewGuide({1: TRUE_CAMERA}, "9x6"),
                      lambda: al.ViewGuide({1: TRUE_CAMERA}, board, min_pan_deg=5, max_pan_deg=-5),
                      lambda: al.ViewGuide({1: TRUE_CAMERA}, board, colour=1), lambda: guide.push(2, (0, 0), corners),
                      lambda: guide.push(1, (0, np.nan), corners), lambda: guide.push(1, (0,), corners),
                      lambda: guide.push(1, (0, 0), np.zeros((3, 2)))):
            with self.assertRaises(ValueError) as caught:
                wrong()
            self.assertNotIn("\n", str(caught.exception))
        self.assertEqual(guide.state.views, 0)


if __name__ == "__main__":
    unittest.main()

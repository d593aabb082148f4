"""Calibrations against cv2, mrcal and the command; results as values."""
import copy
import json
import os
import pathlib
import pickle
import signal
import threading
import time
import unittest

import cv2
import mrcal
import numpy as np

import alidade as al
from common import BOARD, TRUE_CAMERA, InFolder, assert_same_table, board_corners, command

SIZE = TRUE_CAMERA.size


def without_time(text):
    document = json.loads(text)
    for key in ("argv", "created_utc", "seconds"):
        document.pop(key)
    return document


class FromCorners(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.corners = board_corners()
        cls.result = al.calibrate(corners=cls.corners, size=SIZE, board=BOARD)

    def test_is_opencvs_answer(self):
        objects = [BOARD.points.astype(np.float32)] * len(self.corners)
        rms, K, dist, rvecs, tvecs = cv2.calibrateCamera(
            objects, [each.astype(np.float32).reshape(-1, 1, 2) for each in self.corners], SIZE, None, None,
            criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-14))
        theirs = al.Camera.from_opencv(K, dist, SIZE)
        # cv2 takes the corners as float32, which moves them by 3e-5 px
        for name in ("fx", "fy", "cx", "cy"):
            self.assertAlmostEqual(getattr(self.result.camera, name), getattr(theirs, name), delta=1e-3)
        px = np.stack(np.meshgrid(np.linspace(0, 639, 9), np.linspace(0, 479, 7)), axis=-1)
        apart = self.result.camera.project(theirs.unproject(px)) - px
        self.assertLess(np.nanmax(np.abs(apart)), 1e-3)
        self.assertAlmostEqual(self.result.rms_px, rms, delta=1e-5)

    def test_stands_and_covers_the_truth(self):
        self.assertIn(self.result.verdict.state, ("good", "care"))
        self.assertIs(self.result.require(), self.result)
        camera = self.result.camera
        free = np.diag(camera.covariance) > 0
        z = (camera.parameters - TRUE_CAMERA.parameters)[free] / np.sqrt(np.diag(camera.covariance)[free])
        self.assertLess(np.abs(z).max(), 5.0)
        self.assertEqual(camera.covariance.shape, (10, 10))
        self.assertEqual(self.result.covariance.shape, (9, 9))
        self.assertEqual([name for name, is_free in zip(camera.parameter_names, free) if is_free], self.result.parameter_names)

    def test_model_covariance_is_mrcals(self):
        # stddev_model is that of corners that err by themselves, as mrcal and OpenCV count them
        sigma = 0.2
        result = al.calibrate(corners=self.corners, sigma_px=sigma, size=SIZE, board=BOARD, board_shape="flat",
                              outliers="keep")
        views = len(self.corners)
        observations = np.concatenate((self.corners, np.ones((*self.corners.shape[:2], 1))), axis=2).reshape(views, 6, 9, 3)
        poses = np.zeros((views, 6))
        for i, view in enumerate(self.corners):
            K, dist = result.camera.to_opencv()
            _, rvec, tvec = cv2.solvePnP(BOARD.points, view, K, dist)
            poses[i] = np.concatenate((rvec.ravel(), tvec.ravel()))
        indices = np.array([[i, 0, -1] for i in range(views)], dtype=np.int32)
        values = dict(zip(result.camera.parameter_names, result.camera.parameters))
        intrinsics = np.array([[values[n] for n in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")]])
        inputs = dict(intrinsics=intrinsics, extrinsics_rt_fromref=np.zeros((0, 6)), frames_rt_toref=poses, points=None,
                      observations_board=observations, indices_frame_camintrinsics_camextrinsics=indices,
                      observations_point=None, indices_point_camintrinsics_camextrinsics=None, lensmodel="LENSMODEL_OPENCV5",
                      imagersizes=np.array([SIZE], dtype=np.int32), calibration_object_spacing=0.025,
                      do_optimize_calobject_warp=False, calobject_warp=None, do_apply_regularization=False,
                      do_apply_outlier_rejection=False, verbose=False)
        mrcal.optimize(**inputs)
        _, _, J, _ = mrcal.optimizer_callback(**inputs, no_factorization=True)
        # columns of mrcal's packed state: scaled, intrinsics first
        count = mrcal.num_states_intrinsics(**inputs)
        information = (J.T @ J).toarray()
        scale = np.ones((1, information.shape[0]))
        mrcal.unpack_state(scale, **inputs)
        covariance = sigma ** 2 * np.linalg.inv(information)[:count, :count] * np.outer(scale[0, :count], scale[0, :count])
        free = np.array([name != "skew" for name in result.camera.parameter_names])
        ours = result.model_covariance[np.ix_(free, free)]
        order = [result.parameter_names.index(name) for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")]
        # ours has its scale from the residuals as well
        np.testing.assert_allclose(np.sqrt(np.diag(ours)[order]), result.noise_px / sigma * np.sqrt(np.diag(covariance)), rtol=0.01)
        self.assertEqual(result.stddev_model["camera"]["fx"], np.sqrt(ours[0, 0]))

    def test_shapes_of_corners_and_sigma_are_alike(self):
        sigma = np.full(self.corners.shape[:2], 0.3)
        covariance = np.zeros((*self.corners.shape, 2))
        covariance[..., 0, 0] = covariance[..., 1, 1] = 0.3 ** 2
        one = al.calibrate(corners=self.corners, sigma_px=0.3, size=SIZE, board=BOARD, board_shape="flat")
        for corners, given in ((self.corners, sigma), (self.corners[:, :, None], covariance), (self.corners.tolist(), sigma)):
            same = al.calibrate(corners=corners, sigma_px=given, size=f"{SIZE[0]}x{SIZE[1]}", board=BOARD, board_shape="flat")
            np.testing.assert_allclose(same.camera.parameters, one.camera.parameters, rtol=1e-12)

    def test_a_covariance_is_symmetric_and_positive(self):
        for wrong in ([[0.09, 0.02], [0.0, 0.09]], [[0.09, 0.0], [0.02, 0.09]], [[0.09, 0.1], [0.1, 0.09]], [[np.nan, 0.0], [0.0, 0.09]]):
            covariance = np.tile(0.09 * np.eye(2), (*self.corners.shape[:2], 1, 1))
            covariance[2, 3] = wrong
            with self.subTest(wrong=wrong), self.assertRaises(ValueError):
                al.calibrate(corners=self.corners, sigma_px=covariance, size=SIZE, board=BOARD)

    def test_unseen_corners_are_nan(self):
        partial = self.corners.copy()
        partial[::2, :20] = np.nan
        result = al.calibrate(corners=partial, size=SIZE, board=BOARD)
        self.assertEqual(len(result.tables["corners"]), np.isfinite(partial[..., 0]).sum())

    def test_a_table_has_the_answer_of_the_arrays(self):
        columns = {"photo": np.repeat([f"{i}.png" for i in range(len(self.corners))], 54),
                   "corner": np.tile(np.arange(54), len(self.corners)),
                   "u_px": self.corners[..., 0].ravel(), "v_px": self.corners[..., 1].ravel()}
        import pandas
        for table in (columns, pandas.DataFrame(columns)):
            result = al.calibrate(corners=table, size=SIZE, board=BOARD)
            np.testing.assert_array_equal(result.camera.parameters, self.result.camera.parameters)

    def test_wrong_input_is_one_clear_line(self):
        good = dict(corners=self.corners, size=SIZE, board=BOARD)
        for change in (dict(corners=self.corners[:, :5]), dict(corners=self.corners[:0]), dict(corners="absent.csv"),
                       dict(corners=np.full_like(self.corners, np.inf)), dict(corners=self.corners.astype(str)),
                       dict(size=(0, 0)), dict(size="wide"), dict(size=(20, 20)), dict(board="9x6"), dict(sigma_px=-1.0),
                       dict(sigma_px=np.ones(3)), dict(model="lens"), dict(fixed=["k9"]), dict(photos=["a.png"]),
                       dict(corners=None), dict(prior={"fx": 3}), dict(board_shape="round"), dict(glass_m=99.0),
                       dict(board_points=np.zeros((3, 3)))):
            with self.subTest(change=str(change)[:60]), self.assertRaises(ValueError) as caught:
                al.calibrate(**{**good, **change})
            self.assertNotIn("\n", str(caught.exception))
        with self.assertRaises(TypeError):
            al.calibrate(**good, sigma=1.0)

    def test_keywords_are_fields_or_options(self):
        by_field = al.calibrate(corners=self.corners, size=SIZE, board=BOARD, fixed=["k3"], prior={"fx": (530.0, 5.0)})
        by_option = al.calibrate(corners=self.corners, size=SIZE, board=BOARD, fix="k3", prior="fx=530:5")
        self.assertEqual(by_field, by_option)
        self.assertEqual(by_field.camera.k3, 0.0)

    def test_too_little_is_refused_by_the_verdict(self):
        result = al.calibrate(corners=self.corners[:1], size=SIZE, board=BOARD)
        self.assertEqual(result.verdict.state, "refused")
        self.assertFalse(result.verdict)
        self.assertIsNone(result.camera)
        with self.assertRaises(al.CannotDetermine) as caught:
            result.require()
        self.assertIn(result.verdict.sentence, str(caught.exception))

    def test_tables_pickles_and_words(self):
        import pandas
        frame = pandas.DataFrame(self.result.tables["corners"])
        self.assertEqual(len(frame), self.corners.size // 2)
        given = self.corners.reshape(-1, 2)
        np.testing.assert_allclose(np.column_stack([frame["u_px"], frame["v_px"]]), given, rtol=0, atol=1e-9)
        again = al.calibrate(corners=self.result.tables["corners"], size=SIZE, board=BOARD)
        np.testing.assert_allclose(again.camera.parameters, self.result.camera.parameters, rtol=1e-6)
        self.assertEqual(len(self.result.tables["poses"]), len(self.corners))
        self.assertIn("sigma_px", self.result.grids["sigma_working"])
        again = pickle.loads(pickle.dumps(self.result))
        self.assertEqual(again, self.result)
        self.assertEqual(again.camera, self.result.camera)
        for name in self.result.tables:
            assert_same_table(again.tables[name], self.result.tables[name], name)
        self.assertIs(copy.deepcopy(self.result), self.result)
        self.assertIn("fx", repr(self.result))
        self.assertIn("●" if self.result.verdict.state == "good" else "◆", repr(self.result))
        self.assertIn("<table>", self.result._repr_html_())
        self.assertIn("<iframe", self.result.report()._repr_html_())
        self.assertEqual(self.result.document()["estimate"], self.result.estimate)

    def test_figures(self):
        import matplotlib
        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
        plot = self.result.plot
        axes = plt.figure().subplots()
        self.assertIs(plot.residuals(axes), axes)
        for ax in (plot.sigma_map(), plot.coverage(), plot.images(), plot.extrinsics(), plot.diff(TRUE_CAMERA)):
            ax.figure.canvas.draw()
        with self.assertRaises(ValueError):
            plot.sigma_map(at="moon")
        plt.close("all")

    def test_threads_have_the_same_answer(self):
        answers = [None] * 4

        def work(i):
            answers[i] = al.calibrate(corners=self.corners, size=SIZE, board=BOARD)

        threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        for answer in answers:
            np.testing.assert_array_equal(answer.camera.parameters, self.result.camera.parameters)


class Photos(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.photos = cls.folder / "photos"
        done = command("simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "7", "--size", "640x480",
                       "--out", cls.photos, "--quiet")
        assert done.returncode == 0, done.stderr
        cls.files = sorted(cls.photos.glob("*.png"))
        cls.result = al.calibrate(f"{cls.photos}/*.png", board=BOARD)

    def test_saves_what_the_command_leaves(self):
        by_command, by_python = self.folder / "a", self.folder / "b"
        done = command("calibrate", *self.files, "--board", "9x6", "--square", "0.025", "--out", by_command, "--quiet")
        self.assertIn(done.returncode, (0, 6), done.stderr)
        self.result.save(by_python)
        names = sorted(each.name for each in by_command.iterdir())
        self.assertEqual(names, sorted(each.name for each in by_python.iterdir()))
        ours, theirs = ((folder / "result.json").read_text() for folder in (by_python, by_command))
        self.assertEqual(without_time(ours), without_time(theirs))
        self.assertEqual(json.loads(ours)["seconds"].keys(), json.loads(theirs)["seconds"].keys())
        for name in set(names) - {"result.json", "report.html"}:
            self.assertEqual((by_python / name).read_bytes(), (by_command / name).read_bytes(), name)
        read = al.read_result(by_command / "result.json")
        self.assertEqual(read, self.result)
        document = json.loads(theirs)
        self.assertEqual(self.result.estimate, document["estimate"])
        self.assertEqual(self.result.verdict.sentence, document["verdict"]["sentence"])
        renamed = by_command / "renamed.json"
        renamed.write_text(theirs)
        self.assertEqual(al.read_result(renamed).estimate, self.result.estimate)
        for wrong in ("camera.yaml", "corners.csv", "absent.json"):  # beside a result, and none
            with self.assertRaisesRegex(ValueError, wrong):
                al.read_result(by_command / wrong)
        for name, table in document["data"].items():
            for column in set(self.result.tables[name].dtype.names) & set(table):
                if name == "corners" and column in ("u_px", "v_px", "sigma_u_px", "sigma_v_px", "corr_uv"):
                    continue  # rounded in the document
                expected = [np.nan if each is None else each for each in table[column]]
                np.testing.assert_array_equal(self.result.tables[name][column], np.array(expected), f"{name}.{column}")
        read.save(self.folder / "c")
        self.assertEqual((self.folder / "c" / "result.json").read_text(), theirs)

    def test_arrays_have_the_answer_of_the_files(self):
        images = [cv2.imread(str(each), cv2.IMREAD_UNCHANGED) for each in self.files]
        result = al.calibrate(images, board=BOARD)
        np.testing.assert_array_equal(result.camera.parameters, self.result.camera.parameters)
        wide = [np.dstack([each] * 3) if each.ndim == 2 else each for each in images]
        shown = al.calibrate([each[:, ::-1][:, ::-1] for each in wide], board=BOARD)
        np.testing.assert_allclose(shown.camera.parameters, self.result.camera.parameters, rtol=1e-3)

    def test_folder_and_paths_are_the_same(self):
        np.testing.assert_array_equal(al.calibrate(self.files, board=BOARD).camera.parameters, self.result.camera.parameters)

    def test_boards_are_found_one_by_one(self):
        finder = al.BoardFinder(BOARD)
        for file in self.files:
            corners, sigma, found = finder.push(cv2.imread(str(file)))
            self.assertTrue(found)
            self.assertEqual((corners.shape, sigma.shape), ((54, 2), (54, 2, 2)))
        result = al.calibrate(**finder.views())
        self.assertAlmostEqual(result.camera.fx, self.result.camera.fx, delta=1.0)
        none = al.find_board(np.zeros((480, 640), np.uint8), BOARD)
        self.assertFalse(none.found)
        self.assertTrue(none.reason)
        np.testing.assert_array_equal(al.find_board(self.files[0], BOARD).corners,
                                      al.find_board(cv2.imread(str(self.files[0]), -1), BOARD).corners)

    def test_wrong_images_are_refused(self):
        for wrong in ([np.zeros((4, 4))], [np.zeros((0, 4), np.uint8)], [np.zeros((2, 2, 2), np.uint8)], [], "absent/*.png",
                      "absent.png", ["absent.png"], [3], [None], 3, object()):
            with self.subTest(wrong=str(wrong)[:40]), self.assertRaises(ValueError):
                al.calibrate(wrong, board=BOARD)
        for wrong in (None, 3, np.zeros((3, 3)), "absent.png"):
            with self.assertRaises(ValueError):
                al.find_board(wrong, BOARD)

    def test_progress_is_reported_and_stops(self):
        reported = []
        al.calibrate(self.files, board=BOARD, progress=lambda *news: reported.append(news))
        self.assertTrue(reported)
        self.assertTrue(all(isinstance(what, str) and done >= 0 and total >= 0 for what, done, total in reported))
        for no in (False, np.False_):
            with self.assertRaises(al.Interrupted):
                al.calibrate(self.files, board=BOARD, progress=lambda *news: no)
        self.assertTrue(al.calibrate(self.files, board=BOARD, progress=lambda *news: np.True_))
        with self.assertRaises(ZeroDivisionError):
            al.calibrate(self.files, board=BOARD, progress=lambda *news: 1 / 0)

    def test_ctrl_c_is_answered_at_once(self):
        pressed = []

        def press():
            time.sleep(0.15)
            pressed.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        files = [file for file in self.files for _ in range(20)]
        images = [cv2.imread(str(file)) for file in files]
        threading.Thread(target=press).start()
        with self.assertRaises(KeyboardInterrupt):
            al.calibrate(images, board=BOARD)
        self.assertLess(time.perf_counter() - pressed[0], 0.2)


class RealPhotos(unittest.TestCase):
    @unittest.skipUnless(os.environ.get("ALIDADE_DATA"), "needs ALIDADE_DATA")
    def test_bouguets_photos(self):
        folder = next(pathlib.Path(os.environ["ALIDADE_DATA"]).glob("**/bouguet-example1"))
        result = al.calibrate(sorted(folder.rglob("*.tif"))[:8], board=al.Board("12x13", square_m=0.03))
        self.assertAlmostEqual(result.camera.fx, 657.4, delta=5.0)


if __name__ == "__main__":
    unittest.main()

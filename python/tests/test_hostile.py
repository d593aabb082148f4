"""Whatever comes in is answered or refused in one line; many threads, and many calls, leave nothing."""
import copy
import json
import os
import re
import shutil
import threading
import unittest

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra import numpy as some_arrays

import alidade as al
from common import BOARD, TRUE_CAMERA, InFolder, board_corners

ANY_ARRAY = some_arrays.arrays(dtype=some.sampled_from([np.float64, np.float32, np.int16, np.uint8, np.uint16, np.complex64, np.bool_, "U3"]),
                               shape=some_arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5))
NUMBERS = some.floats(allow_nan=True, allow_infinity=True, width=64)
ANYTHING = some.one_of(ANY_ARRAY, NUMBERS, some.none(), some.text(max_size=5), some.lists(NUMBERS, max_size=4),
                       some.dictionaries(some.text(max_size=3), NUMBERS, max_size=2))
fuzzed = settings(max_examples=60, deadline=None, database=None)
PIXELS = np.array([[100.0, 100.0], [200.0, 120.0], [300.0, 200.0]])


class Hostile(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.events = al.simulate.track(scenario="C", seed=2, duration=1)
        cls.events.save(cls.folder / "heads")
        cls.rig = cls.folder / "heads" / "rig.yaml"

    def answered_or_refused(self, work):
        try:
            work()
        except (ValueError, TypeError, OverflowError) as error:
            self.assertNotIn("\n", str(error))

    def test_what_is_masked_is_missing(self):
        """It was used."""
        corners = board_corners(num_views=6)
        masked = np.ma.masked_array(corners, mask=np.zeros(corners.shape, bool))
        missing = corners.copy()
        masked[2, 5], missing[2, 5] = np.ma.masked, np.nan
        masked.data[2, 5] = 1.0
        parameters = [al.calibrate(corners=each, size=TRUE_CAMERA.size, board=BOARD).camera.parameters for each in (masked, missing)]
        np.testing.assert_array_equal(*parameters)

    @fuzzed
    @given(ANYTHING)
    def test_boards_are_looked_for_in_anything(self, what):
        finder, guide = al.BoardFinder(BOARD), al.CaptureGuide(BOARD)
        for work in (lambda: al.find_board(what, BOARD), lambda: finder.push(what), lambda: guide.push(what, 0.0),
                     lambda: guide.push_corners(what, (640, 480), 0.0), lambda: TRUE_CAMERA.undistort(what)):
            self.answered_or_refused(work)

    @fuzzed
    @given(ANYTHING, ANYTHING)
    def test_calibrations_of_anything(self, what, other):
        for work in (lambda: al.calibrate(what, board=BOARD), lambda: al.calibrate(corners=what, size=(640, 480), board=BOARD),
                     lambda: al.calibrate(corners=what, sigma_px=other, size=(640, 480), board=BOARD),
                     lambda: al.calibrate(corners=np.full((3, 54, 2), 9.0), sigma_px=other, size=other, board=BOARD)):
            self.answered_or_refused(work)

    @fuzzed
    @given(ANYTHING, ANYTHING, NUMBERS)
    def test_live_estimators_take_anything(self, what, other, t_s):
        tracker, observer = al.Tracker(self.rig), al.Observer((640, 480))
        shots, localizer = al.ShotGuide(TRUE_CAMERA), al.Localizer(TRUE_CAMERA)
        for work in (lambda: tracker.push(1, what, other, t_s), lambda: tracker.push(what, (0.0, 0.0), (1.0, 1.0), t_s),
                     lambda: tracker.push(1, (0.0, 0.0), (1.0, 1.0), t_s, sigma_px=t_s), lambda: tracker.at(t_s),
                     lambda: tracker.finish(), lambda: observer.push(t_s, what, other), lambda: observer.push(t_s, (0.0, 0.1), PIXELS),
                     lambda: observer.push(t_s, what, PIXELS), lambda: observer.finish(),
                     lambda: shots.push(t_s, spot=what, plane=other), lambda: shots.push(1.0, sigma_range_m=t_s),
                     lambda: localizer.push(t_s, what, other), lambda: localizer.push(t_s, [1, 2, 3], PIXELS),
                     lambda: localizer.push_image(t_s, what)):
            self.answered_or_refused(work)

    @fuzzed
    @given(some.dictionaries(some.sampled_from(["t", "pan", "tilt", "p1x", "p1y", "p2x", "p2y", "omega_x", "t_capture_s", "head", "u_px"]),
                             ANYTHING, max_size=6))
    def test_tables_of_anything(self, table):
        for work in (lambda: al.observe(table, size=(640, 480)), lambda: al.track(table, rig=self.rig), lambda: al.identify(table),
                     lambda: al.track(self.events.tables["events"], rig=table), lambda: al.servo(table)):
            self.answered_or_refused(work)

    def test_names_of_files_stand_in_one_line(self):
        for name in ("?\n", "[\r]", "a\x1b[31m?", "x\n", "q\x0b"):
            for work in (lambda: al.calibrate(name, board=BOARD), lambda: al.observe(name, size=(640, 480)), lambda: al.Camera.read(name),
                         lambda: al.track(name, rig=name), lambda: al.Head("sim://", password_file=name)):
                with self.assertRaises(ValueError) as caught:
                    work()
                self.assertTrue(str(caught.exception).isprintable(), str(caught.exception))

    def test_names_of_files_need_not_be_utf_8(self):
        """They were a TypeError of many lines, though glob and the command have them."""
        name = os.fsdecode(b"caf\xe9")
        photos, rig, camera = self.folder / name, self.folder / f"{name}.yaml", self.folder / f"camera_{name}.yaml"
        al.simulate.board(photos=6, size=(640, 480), board=BOARD).save(photos)
        for file in photos.glob("*.png"):
            file.rename(photos / f"{name}_{file.name}")
        shutil.copy(self.rig, rig)
        TRUE_CAMERA.write(camera)
        files = sorted(str(each) for each in photos.glob("*.png"))
        for given in (str(photos), photos, files, f"{photos}/*.png"):
            result = al.calibrate(given, board=BOARD)
            self.assertEqual(result.counts["used"], 6)
        result.save(self.folder / f"{name}_out")
        self.assertEqual(al.read_result(self.folder / f"{name}_out").estimate, result.estimate)
        al.read_result(self.folder / f"{name}_out").save(self.folder / f"{name}_again")
        self.assertTrue(al.find_board(files[0], BOARD))
        self.assertEqual(len(al.corners(files, board=BOARD).tables["corners"]), 6 * 54)
        events = self.events.tables["events"]
        self.assertEqual(al.track(events, rig=rig).estimate, al.track(events, rig=self.rig).estimate)
        self.assertIsNotNone(al.Tracker(rig))
        self.assertEqual(al.Camera.read(camera), TRUE_CAMERA)
        shots = {"range_m": [1.0, 2.0], "photo": files[:2]}
        refused = al.rangefinder(shots, camera=camera, board=BOARD)
        for each in (refused, result, al.read_result(self.folder / f"{name}_out")):
            self.assertTrue(repr(each).encode())
            self.assertTrue([each.tables[table] for table in each.tables])
        self.assertEqual([os.path.basename(each) for each in sorted(result.tables["poses"]["photo"])], [os.path.basename(each) for each in files])
        for work in (lambda: al.Camera.read(name), lambda: al.track(events, rig=name), lambda: al.calibrate(name, board=BOARD),
                     lambda: al.find_board(name, BOARD), lambda: al.calibrate(corners=name, board=BOARD),
                     lambda: al.localize("a", camera=camera, target=name)):
            with self.assertRaises(ValueError) as caught:
                work()
            self.assertRegex(str(caught.exception), r"^[^\n\ud800-\udfff]+$")

    def test_a_zero_byte_is_of_no_name(self):
        """It ended the name, and the message."""
        result, board = self.events, dict(board=BOARD)
        for work in (lambda: al.Camera.read("a\0b"), lambda: al.track("a\0b", rig=self.rig), lambda: al.track("a", rig="a\0b"),
                     lambda: al.calibrate("a\0b", **board), lambda: al.calibrate(["a\0b"], **board), lambda: al.find_board("a\0b", BOARD),
                     lambda: al.Tracker("a\0b"), lambda: result.save("a\0b"), lambda: TRUE_CAMERA.write("a\0b"),
                     lambda: al.calibrate(corners="a\0b", **board)):
            with self.assertRaises(ValueError) as caught:
                work()
            self.assertRegex(str(caught.exception), r"^\w+: 'a\\x00b' holds a zero byte, which no file's name does$")

    def test_a_result_is_left_in_a_folder_that_has_a_name(self):
        """An empty one was the current folder."""
        self.events.save(self.folder / "saved")
        for result in (self.events, al.read_result(self.folder / "saved")):
            self.refusals([(lambda: result.save(""), "folder: is empty; a folder is needed")])

    def test_a_result_that_lacks_something_is_refused_when_it_is_read(self):
        """It was a KeyError, an AttributeError or a TypeError later."""
        folder = self.folder / "damaged"
        al.simulate.rotation(points=6, seed=3, duration=2).save(folder / "log")
        al.observe(folder / "log" / "log.csv", size=(780, 582)).save(folder)
        whole = json.loads((folder / "result.json").read_text())

        def with_change(path, change):
            document = copy.deepcopy(whole)
            inner = document
            for key in path[:-1]:
                inner = inner[key]
            change(inner, path[-1])
            (folder / "result.json").write_text(json.dumps(document))

        def use():
            result = al.read_result(folder)
            return (repr(result), result.verdict, result.command, result.estimate, result.stddev, result.stddev_model, result.counts, result.assumed,
                    result.covariance, dict(result.tables), dict(result.grids), result.files, dir(result), result.verdict.checks)

        self.assertTrue(use())
        must = {"command", "estimate", "stddev", "stddev_model", "covariance", "verdict", "data", "grids", "files", "counts", "assumed"}
        paths = [(key,) for key in whole] + [(key, each) for key in ("verdict", "covariance") for each in whole[key]]
        paths += [("data", each) for each in whole["data"]] + [("grids", each) for each in whole["grids"]]
        for path in paths:
            for change in (dict.__delitem__, *(lambda inner, key, value=value: inner.__setitem__(key, value) for value in (None, -1, "x", [1], {"y": 3}))):
                with_change(path, change)
                with self.subTest(path=path):
                    try:
                        use()
                        self.assertFalse(change is dict.__delitem__ and (path[0] in must and len(path) == 1 or path[0] in ("verdict", "covariance")))
                    except ValueError as error:
                        self.assertRegex(str(error), rf"^{folder}: is no result of alidade: result.json: [^\n]+$")

    def refusals(self, cases):
        for work, said in cases:
            with self.assertRaises(ValueError) as caught:
                work()
            self.assertEqual(str(caught.exception), said)

    def test_files_that_python_made_are_not_named(self):
        shots = {"range_m": [1.0, 2.0], "photo": ["a.png", "b.png"]}
        self.refusals([(lambda: al.observe(np.zeros((5, 3))), "log: a file, or columns by their names, are needed, not an array (5, 3)"),
                       (lambda: al.rangefinder(shots, camera=TRUE_CAMERA, board=BOARD),
                        "shots:2: photo 'a.png': a.png: cannot be read: No such file or directory")])

    def test_options_are_named_as_keywords(self):
        corners, events = board_corners(num_views=4), self.events.tables["events"]
        self.refusals([(lambda: al.Board("9x6", 0.02, marker_m=0.01), "marker_m: a chessboard has none"),
                       (lambda: al.Board("9x6", 0.02, board_kind="charuco"), "board_kind charuco needs marker_m=M"),
                       (lambda: al.calibrate(corners=corners, size=(640, 480), board=BOARD, model="flat_port"),
                        "model flat_port: give the port's thickness in metres, glass=0.01"),
                       (lambda: al.track(events), "track: rig is required; see help(alidade.track)"),
                       (lambda: al.simulate.board(photos=-3), "simulate board: photos: Value -3 not in range 1 to 100000"),
                       (lambda: al.track(events, rig=self.rig, smooth_s=0.1, method="imm"), "smooth: not for method imm")])

    def test_a_target_is_nested_values_or_its_file(self):
        al.simulate.underwater(frames=20, seed=2).save(self.folder / "water")
        file = self.folder / "water" / "target.yaml"
        points = [{key: float(value) for key, value in re.findall(r"(\w+): ([-+.e\d]+)", line)}
                  for line in file.read_text().splitlines() if "{" in line]
        values = {"points": [{**point, "id": int(point["id"])} for point in points]}
        by_values, by_file = (al.localize(self.folder / "water" / "sights.csv", camera=self.folder / "water" / "camera.yaml", target=target)
                              for target in (values, file))
        self.assertTrue(by_values.verdict)
        self.assertEqual(by_values.estimate, by_file.estimate)

    def test_numbers_of_numpy_are_numbers_in_nested_values(self):
        """Object of type int64 is not JSON serializable."""
        plain = {"duration_s": 3.0, "seeds": 1, "hidden_s": [2.2, 2.4]}
        both = [al.servo(each).estimate for each in (plain, {"duration_s": np.float32(3.0), "seeds": np.int64(1), "hidden_s": np.array([2.2, 2.4])})]
        self.assertEqual(*both)

    def test_layouts_and_read_only_arrays(self):
        corners = board_corners(num_views=8)
        expected = al.calibrate(corners=corners, size=TRUE_CAMERA.size, board=BOARD).camera.parameters
        frozen = corners.copy()
        frozen.flags.writeable = False
        for same in (np.asfortranarray(corners), frozen, np.repeat(corners, 2, axis=0)[::2], corners.tolist()):
            np.testing.assert_array_equal(al.calibrate(corners=same, size=TRUE_CAMERA.size, board=BOARD).camera.parameters, expected)
        image = np.random.default_rng(1).integers(0, 255, (480, 1280), dtype=np.uint8)
        self.assertEqual(al.find_board(image[:, ::2], BOARD).reason, al.find_board(image[:, ::2].copy(), BOARD).reason)
        deep = image[:, ::2].astype(np.uint16) * 257
        self.assertEqual(al.find_board(deep.astype(">u2"), BOARD).reason, al.find_board(deep, BOARD).reason)
        np.testing.assert_array_equal(TRUE_CAMERA.undistort(deep.astype(">u2")), TRUE_CAMERA.undistort(deep))
        big_endian = corners.astype(">f8")
        np.testing.assert_array_equal(al.calibrate(corners=big_endian, size=TRUE_CAMERA.size, board=BOARD).camera.parameters, expected)

    def test_eight_threads_have_the_answers_of_one(self):
        corners = board_corners(num_views=8)
        log = al.simulate.rotation(points=6, seed=3, duration=3).tables["log"]
        events = self.events.tables["events"]
        jobs = [lambda: al.calibrate(corners=corners, size=TRUE_CAMERA.size, board=BOARD).estimate,
                lambda: al.observe(log, size=(780, 582)).estimate, lambda: al.track(events, rig=self.rig).estimate,
                lambda: al.simulate.rangefinder(shots=5, seed=1).estimate]
        expected, answers = [job() for job in jobs], [[] for _ in range(8)]

        def work(i):
            for k in range(4):
                answers[i].append(((i + k) % 4, jobs[(i + k) % 4]()))

        threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        for mine in answers:
            self.assertEqual(len(mine), 4)
            for k, answer in mine:
                self.assertEqual(answer, expected[k])

    def test_ten_thousand_calls_leave_nothing(self):
        corners = board_corners(num_views=4)
        image = np.full((48, 64), 128, np.uint8)
        table = {"t": [0.0], "pan": [1.0, 2.0]}

        def resident():
            with open("/proc/self/statm") as file:
                return int(file.read().split()[1]) * 4096

        def calls(count):
            guide = al.CaptureGuide(BOARD)
            for i in range(count):
                guide.push_corners(corners[i % 4], TRUE_CAMERA.size, 0.0)
                al.find_board(image, BOARD)
                al.Board("9x6", square_m=0.025)
                try:
                    al.observe(table)
                except ValueError:
                    pass
                if i % 50 == 0:
                    al.calibrate(corners=corners, size=TRUE_CAMERA.size, board=BOARD).estimate
                    al.track(self.events.tables["events"][:20], rig=self.rig).estimate

        calls(1000)
        before = resident()
        calls(10_000)
        self.assertLess(resident() - before, 6 << 20)


if __name__ == "__main__":
    unittest.main()

"""Whatever comes in is answered or refused in one line; many threads, and many calls, leave nothing."""
import re
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

    def test_layouts_and_read_only_arrays(self):
        corners = board_corners(num_views=8)
        expected = al.calibrate(corners=corners, size=TRUE_CAMERA.size, board=BOARD).camera.parameters
        frozen = corners.copy()
        frozen.flags.writeable = False
        for same in (np.asfortranarray(corners), frozen, np.repeat(corners, 2, axis=0)[::2], corners.tolist()):
            np.testing.assert_array_equal(al.calibrate(corners=same, size=TRUE_CAMERA.size, board=BOARD).camera.parameters, expected)
        image = np.random.default_rng(1).integers(0, 255, (480, 1280), dtype=np.uint8)
        self.assertEqual(al.find_board(image[:, ::2], BOARD).reason, al.find_board(image[:, ::2].copy(), BOARD).reason)
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

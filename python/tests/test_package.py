"""The package as such: import, stub, docs and examples."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np

import alidade as al
from common import BOARD, TRUE_CAMERA, assert_same_table, board_corners, command

ROOT = pathlib.Path(__file__).resolve().parents[2]


def python(*words, **options):
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, **options)


class Package(unittest.TestCase):
    def test_import_is_quiet_and_fast(self):
        done = python("-W", "error", "-c", "import alidade; print(alidade.__version__)")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        # of the processor: beside other work the wall clock says how busy the machine is
        code = "import time, numpy; t = time.process_time(); import alidade; print(time.process_time() - t)"
        seconds = min(float(python("-c", code).stdout) for _ in range(5))
        self.assertLess(seconds, 0.1)

    def test_stub(self):
        package = pathlib.Path(al.__file__).parent
        environment = {**os.environ, "MYPYPATH": str(package.parent)}
        done = python("-m", "mypy.stubtest", "alidade", "--ignore-missing-stub", env=environment)
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr[-3000:])

    def test_what_is_called_otherwise_is_named(self):
        result = al.calibrate(corners=board_corners(8), size=(640, 480), board=BOARD)
        camera = result.camera
        for work, error, words in ((lambda: camera.K, AttributeError, "K, dist = camera.to_opencv()"), (lambda: camera.save, AttributeError, "write(file)"),
                                   (lambda: camera.undistorts, AttributeError, "did you mean 'undistort'?"), (lambda: result.rms, AttributeError, "did you mean 'rms_px'?"),
                                   (lambda: al.calibrate("photos", board=BOARD, modle="brown"), TypeError, "did you mean 'model'?"),
                                   (lambda: al.calibrate("photos", board="9x6", square_m=0.025), TypeError, "al.Board("),
                                   (lambda: al.track("events.csv", rig="rig.yaml", square_m=0.025), TypeError, "no keyword"),
                                   (lambda: camera.undistort("photo.png"), ValueError, "cv2.imread('photo.png') reads one")):
            with self.subTest(words=words), self.assertRaises(error) as caught:
                work()
            self.assertIn(words, str(caught.exception))

    def test_boards_are_values(self):
        import copy
        import pickle
        board = al.Board((5, 4), "25mm", "charuco", marker_m=0.018)
        for same in (pickle.loads(pickle.dumps(board)), copy.copy(board), eval(repr(board), {"Board": al.Board})):
            self.assertEqual(same, board)
        self.assertEqual((board.cols, board.rows, board.square_m, board.kind, board.dictionary),
                         (5, 4, 0.025, "charuco", "DICT_5X5_100"))
        self.assertEqual(BOARD.points.shape, (54, 3))
        for wrong in (("9", 0.025), ("9x6", 25), ("9x6", -1), ((9, 6), None), ("9x6", 0.025, "table"),
                      ("9x6", 0.025, "charuco"), (object(), 0.025)):
            with self.subTest(wrong=wrong), self.assertRaises((ValueError, TypeError)):
                al.Board(*wrong)

    def test_what_is_public_is_pickled_and_copied_or_refused_in_one_line(self):
        """Tables and grids ended the process (protocols 0 and 1), or named the module's core; a ViewGuide's copy was the same guide."""
        import copy
        import pickle
        result = al.calibrate(corners=board_corners(8), size=(640, 480), board=BOARD)
        detection, finder = al.find_board(np.zeros((48, 64), np.uint8), BOARD), al.BoardFinder(BOARD)
        values = (result, result.verdict, result.verdict.checks[0], result.tables, result.grids, result.camera, result.plot, result.report(), BOARD,
                  detection, finder, al.Interrupted("x"), al.CannotDetermine("y"))
        streams = (al.CaptureGuide(BOARD), al.ShotGuide(TRUE_CAMERA, BOARD), al.ViewGuide({1: TRUE_CAMERA}, BOARD), al.Observer((640, 480)),
                   al.Localizer(TRUE_CAMERA), al.Head("sim://?seed=3"))
        works = [copy.copy, copy.deepcopy, *(lambda value, protocol=protocol: pickle.loads(pickle.dumps(value, protocol)) for protocol in range(2, 6))]
        for work in works:
            for value in values:
                self.assertIs(type(work(value)), type(value))
            for tables in (work(result.tables), work(work(result.tables))):
                self.assertEqual(list(tables), list(result.tables))
                for name in tables:
                    assert_same_table(tables[name], result.tables[name], name)
            grids = work(result.grids)
            self.assertEqual(list(grids), list(result.grids))
            for name in grids:
                np.testing.assert_equal(grids[name], result.grids[name])
        for protocol in (0, 1):
            self.assertEqual(pickle.loads(pickle.dumps(result, protocol)), result)
            self.assertEqual(list(pickle.loads(pickle.dumps(result.tables, protocol))), list(result.tables))
        for one in (*streams, *(each._core for each in streams if each._core is not None), result._source):
            for work in (copy.copy, copy.deepcopy, *(lambda value, protocol=protocol: pickle.dumps(value, protocol) for protocol in range(6))):
                with self.subTest(one=type(one)), self.assertRaisesRegex(TypeError, r"is neither copied nor pickled[^\n]*$"):
                    work(one)

    def test_code_of_the_docs_runs(self):
        blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.S)
        with tempfile.TemporaryDirectory() as folder:
            done = command("simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "7", "--size", "640x480",
                           "--out", pathlib.Path(folder) / "photos", "--quiet")
            self.assertEqual(done.returncode, 0, done.stderr)
            al.simulate.track(scenario="C").save(pathlib.Path(folder) / "heads")
            code = "\n".join(["import matplotlib; matplotlib.use('Agg')", *blocks])
            done = python("-c", code, cwd=folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("±", done.stdout)

    def test_examples_run(self):
        examples = ROOT / "examples" / "python"
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            al.simulate.rotation(points=8).save(folder / "turn")
            done = python(examples / "observe_log.py", folder / "turn" / "log.csv", "780", "582")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("fx", done.stdout)
            log = (folder / "turn" / "log.csv").read_text()
            done = python(examples / "observe_live.py", "780", "582", input=log)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("fx", done.stdout)
            al.simulate.track(scenario="C", duration=3).save(folder / "heads")
            done = python(examples / "follow_target.py", folder / "heads" / "events.csv", folder / "heads" / "rig.yaml")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("3σ of z", done.stdout)
            al.simulate.underwater(frames=30).save(folder / "dive")
            done = python(examples / "where_am_i.py", *(folder / "dive" / name for name in ("sights.csv", "camera.yaml", "target.yaml")))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(" m  ", done.stdout)
            command("simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "7", "--size", "640x480",
                    "--out", folder / "photos", "--quiet")
            done = python(examples / "webcam.py", str(folder / "photos" / "*.png"), cwd=folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("fx", done.stdout)


if __name__ == "__main__":
    unittest.main()

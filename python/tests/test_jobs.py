"""Jobs from files and from columns against the command, value by value."""
import json
import unittest

import numpy as np

import alidade as al
from common import InFolder, assert_same_table, command


def values(path):
    document = json.loads((path / "result.json").read_text())
    return {key: document[key] for key in ("verdict", "counts", "estimate", "stddev", "covariance", "data", "grids", "files")}


class Jobs(InFolder):
    def same_as_command(self, result, *words):
        out, saved = self.folder / "command", self.folder / "python"
        done = command(*words, "--out", out, "--quiet")
        self.assertIn(done.returncode, (0, 4, 5, 6), done.stderr)
        result.save(saved)
        self.assertEqual(values(saved), values(out))
        for name in json.loads((out / "result.json").read_text())["files"]:
            self.assertEqual((saved / name).read_bytes(), (out / name).read_bytes(), name)
        self.assertEqual(result.estimate, values(out)["estimate"])
        self.assertEqual(result.verdict.exit_code, done.returncode)

    def test_observe(self):
        made = al.simulate.rotation(points=8, seed=3)
        self.assertEqual(made, al.simulate.rotation(points=8, seed=3))
        made.save(self.folder / "turn")
        log = self.folder / "turn" / "log.csv"
        result = al.observe(log, size=(780, 582))
        self.same_as_command(result, "observe", log, "--size", "780x582")
        columns = al.observe(made.tables["log"], size=(780, 582))
        self.assertEqual(columns.estimate, result.estimate)
        self.assertEqual(len(columns.tables["intrinsics"]), len(made.tables["log"]))
        self.assertAlmostEqual(result.camera.fx, result.estimate["camera"]["fx"], delta=1e-6)

    def test_times_of_any_kind_are_the_same(self):
        """datetime64[ns] was taken for seconds."""
        made = al.simulate.rotation(seed=1)
        table = made.tables["log"]
        columns = {name: table[name] for name in table.dtype.names}
        seconds = np.round(columns.pop("t") * 1e6).astype(np.int64)
        since = np.datetime64("2026-01-01T00:00:00", "us").astype(np.int64)
        expected = al.observe({"t": (seconds + since) * 1e-6, **columns}, size=(780, 582)).camera.parameters
        for unit in ("us", "ns"):
            times = (seconds + since).astype("datetime64[us]").astype(f"datetime64[{unit}]")
            result = al.observe({"t": times, **columns}, size=(780, 582))
            np.testing.assert_allclose(result.camera.parameters, expected, rtol=1e-6)

    def test_track(self):
        import pandas
        made = al.simulate.track(scenario="C", seed=2)
        made.save(self.folder / "events")
        events, rig = self.folder / "events" / "events.csv", self.folder / "events" / "rig.yaml"
        result = al.track(events, rig=rig)
        self.same_as_command(result, "track", events, "--rig", rig)
        for table in (made.tables["events"], dict((n, made.tables["events"][n]) for n in made.tables["events"].dtype.names),
                      pandas.DataFrame(made.tables["events"])):
            assert_same_table(al.track(table, rig=rig).tables["track"], result.tables["track"])
        self.assertGreater(len(result.tables["track"]), 10)
        self.assertEqual(al.track(events, rig=rig, method="cv"), result)

    def test_studies_and_papers(self):
        result = al.study.observe(trials=300, seed=5)
        self.same_as_command(result, "study", "observe", "--trials", "300", "--seed", "5")
        self.assertEqual(result.estimate["trials"], 300)
        one = al.study.observe(trials=300, seed=5, trial=7)
        self.assertIn("fx", one.verdict.sentence)
        with self.assertRaisesRegex(ValueError, "none of the 300 trials"):
            al.study.observe(trials=300, trial=300)
        with self.assertRaisesRegex(ValueError, "paper"):
            al.reproduce("nobody1999")

    def test_rangefinder_and_rig(self):
        board = al.Board("9x6", square_m=0.04)
        made = self.folder / "shots"
        al.simulate.rangefinder(shots=12).save(made)
        given = dict(corners=made / "corners.csv", board=board)
        result = al.rangefinder(made / "shots.csv", camera=made / "camera.yaml", **given)
        self.same_as_command(result, "rangefinder", made / "shots.csv", "--camera", made / "camera.yaml", "--board", "9x6",
                             "--square", "0.04", "--corners", made / "corners.csv")
        ranges = [0.5, 1.0, 2.5]
        spots = al.project(beam=result, camera=made / "camera.yaml", range=ranges)
        result.save(self.folder / "beam")
        self.same_as_command(spots, "project", "--beam", self.folder / "beam" / "rangefinder.yaml", "--camera", made / "camera.yaml",
                             "--range", "0.5,1,2.5")
        origin, direction = (np.array(result.estimate[name]) for name in ("origin_m", "direction"))
        points = origin + np.outer(result.estimate["scale"] * np.array(ranges), direction)
        pixels = al.Camera.read(made / "camera.yaml").project(points)
        table = spots.tables[list(spots.tables)[0]]
        np.testing.assert_allclose(np.column_stack([table["u_px"], table["v_px"]]), pixels, atol=2e-3)
        with self.assertRaisesRegex(ValueError, "beam"):
            al.project(range=ranges)
        by_value = al.rangefinder(made / "shots.csv", camera=al.Camera.read(made / "camera.yaml"), **given)
        self.assertEqual(by_value.estimate, result.estimate)
        self.assertEqual(result.direction.shape, (3,))
        views = self.folder / "views"
        al.simulate.rig().save(views)
        cameras = [views / "camera_1.yaml", views / "camera_2.yaml"]
        rig = al.rig(views / "views.csv", cameras=cameras, board=al.Board("9x6", square_m=0.025))
        self.assertIn("rig.yaml", rig.files)
        numbers = np.genfromtxt(views / "views.csv", delimiter=",", names=True)  # float64, heads and corners as well
        for table, word in ((numbers, "cameras"), (views / "views.csv", "camera")):
            same = al.rig(table, board=al.Board("9x6", square_m=0.025), **{word: [al.Camera.read(each) for each in cameras]})
            self.assertEqual(same.estimate, rig.estimate)
        with self.assertRaises(TypeError):
            al.rig(views / "views.csv", cameras=cameras, camera=cameras, board=al.Board("9x6", square_m=0.025))

    def test_images_take_the_place_of_files(self):
        import cv2
        import pandas
        made = self.folder / "film"
        al.simulate.underwater(video=True, frames=8, rate=30.0).save(made)
        files = sorted(each for each in (made / "frames").iterdir() if each.suffix == ".png")
        given = dict(rate_hz=30.0, camera=made / "camera.yaml", target=made / "target.yaml")
        images = [cv2.imread(str(each), cv2.IMREAD_UNCHANGED) for each in files]
        by_files, by_arrays = al.localize(made / "frames", **given), al.localize(images, **given)
        for column in ("x_m", "y_m", "z_m"):
            self.assertEqual(by_files.tables["trajectory"][column].tolist(), by_arrays.tables["trajectory"][column].tolist())
        shots = self.folder / "photographed"
        al.simulate.rangefinder(photos=True, shots=6).save(shots)
        table = pandas.read_csv(shots / "shots.csv")
        board = al.Board("9x6", square_m=0.04)
        by_file = al.rangefinder(shots / "shots.csv", camera=shots / "camera.yaml", board=board)
        named = [column for column in ("photo", "photo_off") if column in table]
        for change in (lambda name: str(shots / name), lambda name: cv2.imread(str(shots / name), cv2.IMREAD_UNCHANGED)):
            columns = {column: [change(cell) if column in named else cell for cell in table[column]] for column in table}
            self.assertEqual(al.rangefinder(columns, camera=shots / "camera.yaml", board=board).origin_m.tolist(),
                             by_file.origin_m.tolist())

    def test_wrong_use_is_a_value_error_in_the_commands_words(self):
        for work, words in ((lambda: al.track(rig="absent.yaml"), "events"), (lambda: al.observe("absent.csv"), "absent.csv"),
                            (lambda: al.track("absent.csv", rig="absent.yaml"), "absent.yaml"),
                            (lambda: al.observe({"t": [0.0]}, size=(100, 100)), "log"),
                            (lambda: al.observe({"t": [0.0], "pan": [1.0, 2.0]}), "differ in length"),
                            (lambda: al.observe({"t": [0.0], "pan": ["x"], "tilt": [0.0], "p1x": [1.0], "p1y": [1.0]}), "log:2"),
                            (lambda: al.observe("-", size=(1, 1)), "is no file"),
                            (lambda: al.track("e.csv", rig="r.yaml", method="cw"), "cw"),
                            (lambda: al.track("e.csv", rig="r.yaml", sigma_px=-1.0), "sigma_px"),
                            (lambda: al.servo(object()), "scenario")):
            with self.subTest(words=words), self.assertRaises(ValueError) as caught:
                work()
            self.assertIn(words, str(caught.exception))
            self.assertNotIn("\n", str(caught.exception))
        with self.assertRaises(TypeError):
            al.track("e.csv", rig="r.yaml", sigmas=1.0)

    def test_the_docs_say_what_a_keyword_is(self):
        self.assertIn("sigma_px: ", al.track.__doc__)
        self.assertIn("fixed: ", al.calibrate.__doc__)


if __name__ == "__main__":
    unittest.main()

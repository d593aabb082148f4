"""Numbers that nobody meant, in every column of every job: each is answered or refused by name, in one line; what is answered with a
good verdict has no value that is not finite."""
import json
import math
import pathlib
import unittest

import numpy as np

import alidade as al
from common import BOARD, InFolder, board_corners

WRONG = {
    "nan": lambda column: np.full_like(column, np.nan), "inf": lambda column: np.full_like(column, np.inf),
    "all equal": lambda column: np.full_like(column, column[0]), "zero": lambda column: np.zeros_like(column),
    "times 1e6": lambda column: column * 1e6, "times 1e-6": lambda column: column * 1e-6,
    "times 1e150": lambda column: column * 1e150, "times 1e-150": lambda column: column * 1e-150,
    "denormal": lambda column: np.full_like(column, 5e-324), "negative": lambda column: -column,
    "reversed": lambda column: column[::-1], "one nan": lambda column: np.where(np.arange(len(column)) == 3, np.nan, column),
    "one 1e300": lambda column: np.where(np.arange(len(column)) == 3, 1e300, column),
    "shuffled": lambda column: np.random.default_rng(1).permutation(column),
}


def not_finite(value, path=""):
    """Names of values that are not finite numbers, in a document."""
    if isinstance(value, dict):
        return [bad for name, each in value.items() for bad in not_finite(each, f"{path}.{name}")]
    if isinstance(value, list):
        return [bad for i, each in enumerate(value) for bad in not_finite(each, f"{path}[{i}]")]
    return [path] if isinstance(value, float) and not math.isfinite(value) else []


class Numbers(InFolder):
    def answered_or_refused(self, work, name):
        try:
            result = work()
        except ValueError as refused:
            self.assertNotIn("\n", str(refused), name)
            self.assertGreater(len(str(refused)), 10, name)
            return
        result.save(self.folder / "kept")
        document = json.loads((self.folder / "kept" / "result.json").read_text(), parse_constant=lambda text: math.nan)
        if document["verdict"]["exit_code"] == 0:
            self.assertEqual(not_finite(document["estimate"]) + not_finite(document.get("stddev", {})), [], name)

    def every_column(self, table, work):
        columns = {name: np.array(table[name]) for name in table.dtype.names}
        for column, values in columns.items():
            if values.dtype.kind != "f":
                continue
            for name, change in WRONG.items():
                with self.subTest(column=column, numbers=name):
                    self.answered_or_refused(lambda: work({**columns, column: change(values)}), f"{column} {name}")

    def test_observe(self):
        table = al.simulate.rotation(points=4, seed=3, duration=1).tables["log"]
        self.every_column(table, lambda log: al.observe(log, size=(780, 582)))

    def test_track(self):
        made = al.simulate.track(scenario="C", seed=2, duration=1)
        made.save(self.folder / "track")
        rig = self.folder / "track" / "rig.yaml"
        self.every_column(made.tables["events"], lambda events: al.track(events, rig=rig))

    def test_identify(self):
        self.every_column(al.simulate.servo(seed=3).tables["log"], al.identify)

    def test_calibrate(self):
        corners = board_corners(num_views=6)
        for axis in (0, 1):
            for name, change in WRONG.items():
                changed = corners.copy()
                changed[..., axis] = change(corners[..., axis].ravel()).reshape(corners.shape[:2])
                with self.subTest(axis=axis, numbers=name):
                    self.answered_or_refused(lambda: al.calibrate(corners=changed, size=(640, 480), board=BOARD), name)

    def test_every_column_of_files_of_rangefinder_and_localize(self):
        al.simulate.rangefinder(shots=6, seed=4).save(self.folder / "shots")
        al.simulate.underwater(frames=6, seed=4).save(self.folder / "dive")
        board = al.Board("9x6", square_m=0.04)
        works = {
            "shots/shots.csv": lambda file: al.rangefinder(file, camera=self.folder / "shots/camera.yaml", board=board,
                                                           corners=self.folder / "shots/corners.csv"),
            "dive/sights.csv": lambda file: al.localize(file, camera=self.folder / "dive/camera.yaml", target=self.folder / "dive/target.yaml"),
        }
        for source, work in works.items():
            rows = [line.split(",") for line in pathlib.Path(self.folder / source).read_text().splitlines()]
            file = pathlib.Path(self.folder / source).with_name("changed.csv")
            for place, column in enumerate(rows[0]):
                try:
                    values = np.array([float(row[place]) for row in rows[1:]])
                except ValueError:
                    continue
                for name, change in WRONG.items():
                    changed = change(values)
                    text = [",".join(rows[0])] + [",".join([*row[:place], repr(float(changed[i])), *row[place + 1:]]) for i, row in enumerate(rows[1:])]
                    file.write_text("\n".join(text) + "\n")
                    with self.subTest(file=source, column=column, numbers=name):
                        self.answered_or_refused(lambda: work(file), f"{column} {name}")


if __name__ == "__main__":
    unittest.main()

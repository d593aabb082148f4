"""Symmetries as oracles: what is only said otherwise (another order, another unit, a world that stands elsewhere, an image that is
mirrored, turned or finer) moves the estimate as geometry says it must, to a small part of its σ, and σ with it."""
import pathlib
import tempfile
import unittest

import numpy as np
import yaml

import alidade as al
from common import BOARD, InFolder, board_corners, command, rotation

SIZE = (640, 480)
LEVEL = 1e-6  # of σ, for what is the same numbers in another order or unit
SOLVED = 1e-3  # of σ, where a solver begins elsewhere and ends within its tolerance


def values_of(camera):
    return {name: getattr(camera, name) for name in camera.parameter_names}


def sigmas_of(camera):
    """Of the values that were estimated."""
    sigmas = np.sqrt(np.diag(camera.covariance))
    return {name: sigma for name, sigma in zip(camera.parameter_names, sigmas) if sigma > 0.0}


class OfCalibrate(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.corners = board_corners(num_views=12)
        cls.given = dict(size=SIZE, board=BOARD)
        cls.result = al.calibrate(corners=cls.corners, **cls.given)

    def same(self, other, level, expected=None, sigma_factor=None):
        """The other camera is the expected one (default: this), each value and each σ."""
        want, sigma = values_of(self.result.camera), sigmas_of(self.result.camera)
        expected, factor = {**want, **(expected or {})}, sigma_factor or {}
        got, other_sigma = values_of(other.camera), sigmas_of(other.camera)
        self.assertEqual(other_sigma.keys(), sigma.keys())
        for name in sigma:
            scale = sigma[name] * factor.get(name, 1.0)
            self.assertLess(abs(got[name] - expected[name]), level * scale + 1e-12 * abs(expected[name]),
                            f"{name}: {got[name]} for {expected[name]}, σ {scale}")
            self.assertAlmostEqual(other_sigma[name] / scale, 1.0, delta=max(1e-6, level), msg=f"σ of {name}")
        self.assertEqual(other.verdict.state, self.result.verdict.state)

    def test_order_of_photos(self):
        order = np.random.default_rng(5).permutation(len(self.corners))
        self.same(al.calibrate(corners=self.corners[order], **self.given), SOLVED)

    def test_threads(self):
        with tempfile.TemporaryDirectory() as folder:
            self.result.save(folder)
            cameras = set()
            for threads in (1, 2, 7, 64):
                done = command("calibrate", "--corners", f"{folder}/corners.csv", "--size", "640x480", "--board", "9x6", "--square", "0.025",
                               "--threads", threads, "--no-report", "--out", f"{folder}/{threads}")
                self.assertEqual(done.returncode, 0, done.stderr)
                cameras.add(pathlib.Path(f"{folder}/{threads}/camera.yaml").read_bytes())
            self.assertEqual(len(cameras), 1)

    def test_a_board_of_another_size(self):
        for factor in (0.1, 7.0):
            board = al.Board("9x6", square_m=0.025 * factor)
            with self.subTest(factor=factor):
                self.same(al.calibrate(corners=self.corners, size=SIZE, board=board), SOLVED)

    def test_a_finer_image(self):
        # pixel centres are whole numbers: (u + 1/2) doubles
        doubled = al.calibrate(corners=2 * self.corners + 0.5, size=(1280, 960), board=BOARD)
        now = values_of(self.result.camera)
        self.same(doubled, SOLVED, {"fx": 2 * now["fx"], "fy": 2 * now["fy"], "cx": 2 * now["cx"] + 0.5, "cy": 2 * now["cy"] + 0.5},
                  dict.fromkeys(("fx", "fy", "cx", "cy"), 2.0))

    def test_a_mirrored_image(self):
        # u -> W - 1 - u, and the board's columns with it, so that the board is not mirrored
        mirrored = self.corners * [-1, 1] + [SIZE[0] - 1, 0]
        mirrored = mirrored.reshape(len(mirrored), 6, 9, 2)[:, :, ::-1].reshape(self.corners.shape)
        now = values_of(self.result.camera)
        self.same(al.calibrate(corners=mirrored, **self.given), SOLVED, {"cx": SIZE[0] - 1 - now["cx"], "p2": -now["p2"]})

    def test_an_image_turned_by_a_quarter(self):
        # (u, v) -> (H - 1 - v, u): x' = -y, y' = x of Brown's model: p1' = p2 ... by its formula below
        turned = np.stack([SIZE[1] - 1 - self.corners[..., 1], self.corners[..., 0]], axis=-1)
        now, sigma = values_of(self.result.camera), sigmas_of(self.result.camera)
        # dx = 2 p1 xy + p2 (r² + 2x²), dy = p1 (r² + 2y²) + 2 p2 xy; in x' = -y, y' = x: p1' = p2, p2' = -p1
        other = al.calibrate(corners=turned, size=SIZE[::-1], board=BOARD)
        got, other_sigma = values_of(other.camera), sigmas_of(other.camera)
        expected = {**now, "fx": now["fy"], "fy": now["fx"], "cx": SIZE[1] - 1 - now["cy"], "cy": now["cx"], "p1": now["p2"],
                    "p2": -now["p1"]}
        partner = {"fx": "fy", "fy": "fx", "cx": "cy", "cy": "cx", "p1": "p2", "p2": "p1"}
        for name in sigma:
            scale = sigma[partner.get(name, name)]
            self.assertLess(abs(got[name] - expected[name]), SOLVED * scale, f"{name}: {got[name]} for {expected[name]}")
            self.assertAlmostEqual(other_sigma[name] / scale, 1.0, delta=SOLVED, msg=f"σ of {name}")


class OfHeads(InFolder):
    """A camera that turns, a target that two heads follow, and the heads themselves."""

    def test_observe_at_another_time(self):
        # an epoch with few digits after the point: a double holds the differences to 2e-7 s
        log = al.simulate.rotation(points=8, seed=3).tables["log"]
        columns = {name: log[name] for name in log.dtype.names}
        columns["t"] = np.round(columns["t"] * 1024) / 1024
        shifted = {**columns, "t": columns["t"] + 1795392000.0}
        one, other = al.observe(columns, size=(780, 582)), al.observe(shifted, size=(780, 582))
        sigma = sigmas_of(one.camera)
        for name, value in values_of(other.camera).items():
            self.assertLess(abs(value - values_of(one.camera)[name]), LEVEL * sigma.get(name, 1.0), name)
        self.assertEqual(one.verdict.state, other.verdict.state)

    def test_observe_with_its_points_in_another_order(self):
        log = al.simulate.rotation(points=8, seed=3).tables["log"]
        columns = {name: log[name] for name in log.dtype.names}
        renamed = {name: values for name, values in columns.items() if not name.startswith("p")}
        for point in range(1, 9):
            for axis in "xy":
                renamed[f"p{9 - point}{axis}"] = columns[f"p{point}{axis}"]
        one, other = al.observe(columns, size=(780, 582)), al.observe(renamed, size=(780, 582))
        sigma = sigmas_of(one.camera)
        for name, value in values_of(other.camera).items():
            self.assertLess(abs(value - values_of(one.camera)[name]), SOLVED * sigma.get(name, 1.0), name)

    def test_track_in_a_world_that_stands_elsewhere(self):
        made = al.simulate.track(scenario="C", seed=2)
        made.save(self.folder / "track")
        file = self.folder / "track" / "rig.yaml"
        rig = yaml.safe_load(file.read_text())
        turn, shift = rotation([0.3, -0.5, 1.1]), np.array([10.0, -4.0, 2.0])
        for head in rig["heads"]:
            head["world_from_base"] = self.moved(head["world_from_base"], turn, shift)
        (self.folder / "moved.yaml").write_text(yaml.safe_dump(rig))
        for name in self.folder.joinpath("track").glob("*camera*"):
            (self.folder / name.name).write_bytes(name.read_bytes())
        # Step by step: track.csv has micrometres, which are more than the millionth of σ that is asked here.
        one, other = al.Tracker(file, sigma_a_m_s2=3.0), al.Tracker(self.folder / "moved.yaml", sigma_a_m_s2=3.0)
        both = np.kron(np.eye(2), turn)  # of position and velocity
        num_known = 0
        for row in made.tables["events"]:
            here, there = (tracker.push(row["head"], (row["pan_rad"], row["tilt_rad"]), (row["u_px"], row["v_px"]), row["t_capture_s"],
                                        row["t_arrival_s"]) for tracker in (one, other))
            self.assertEqual(here["event"], there["event"])
            if here["position_m"] is None:
                continue
            num_known += 1
            sigma = np.sqrt(np.diag(here["covariance"])[:3])
            self.assertLess(np.abs(turn @ here["position_m"] + shift - there["position_m"]).max() / sigma.min(), LEVEL)
            turned = both @ here["covariance"] @ both.T
            self.assertLess(np.abs(turned - there["covariance"]).max() / np.abs(turned).max(), LEVEL)
        self.assertGreater(num_known, 10)

    @staticmethod
    def moved(pose, turn, shift):
        """A pose as rig.yaml writes it, quaternion w x y z, after a motion of the world."""
        quaternion = next(name for name in pose if "quaternion" in name)
        place = next(name for name in pose if name != quaternion)
        w, x, y, z = pose[quaternion]
        R = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                      [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                      [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        R = turn @ R
        w = np.sqrt(max(0.0, 1 + np.trace(R))) / 2
        q = [w, (R[2, 1] - R[1, 2]) / (4 * w), (R[0, 2] - R[2, 0]) / (4 * w), (R[1, 0] - R[0, 1]) / (4 * w)]
        return {quaternion: [float(v) for v in q], place: [float(v) for v in turn @ np.array(pose[place]) + shift]}

    def test_track_by_other_names_and_at_another_time(self):
        made = al.simulate.track(scenario="C", seed=2)
        made.save(self.folder / "names")
        rig = yaml.safe_load((self.folder / "names" / "rig.yaml").read_text())
        events = {name: made.tables["events"][name] for name in made.tables["events"].dtype.names}
        for name in ("t_capture_s", "t_arrival_s"):
            events[name] = np.round(events[name] * 4096) / 4096
        one = al.track(events, rig=self.folder / "names" / "rig.yaml")
        renamed = {head["id"]: head["id"] + 40 for head in rig["heads"]}
        for head in rig["heads"]:
            head["id"] += 40
        (self.folder / "names" / "renamed.yaml").write_text(yaml.safe_dump(rig))
        other = al.track({**events, "head": np.vectorize(renamed.get)(events["head"]),
                          **{name: events[name] + 65536.0 for name in ("t_capture_s", "t_arrival_s")}},
                         rig=self.folder / "names" / "renamed.yaml")
        for column in ("x_m", "y_m", "z_m"):
            a, b = one.tables["track"][column], other.tables["track"][column]
            known = np.isfinite(a)
            np.testing.assert_array_equal(known, np.isfinite(b))
            sigma = one.tables["track"][f"sigma_{column}"][known]
            self.assertLess((np.abs(a - b)[known] / sigma).max(), 1e-5, column)

    def test_rangefinder_in_another_order(self):
        al.simulate.rangefinder(shots=12, seed=4).save(self.folder / "shots")
        text = (self.folder / "shots" / "shots.csv").read_text().splitlines()
        (self.folder / "shots" / "reversed.csv").write_text("\n".join([text[0], *text[:0:-1]]) + "\n")
        given = dict(corners=self.folder / "shots" / "corners.csv", board=al.Board("9x6", square_m=0.04),
                     camera=self.folder / "shots" / "camera.yaml")
        one, other = (al.rangefinder(self.folder / "shots" / name, **given) for name in ("shots.csv", "reversed.csv"))
        sigma = np.sqrt(np.diag(one.covariance))
        np.testing.assert_allclose(other.direction, one.direction, atol=SOLVED * sigma.min())
        self.assertEqual(one.verdict.state, other.verdict.state)

    def test_identify_in_other_units_of_command(self):
        made = al.simulate.servo(seed=3)
        log = made.tables["log"]
        columns = {name: log[name] for name in log.dtype.names}
        one = al.identify(columns)
        other = al.identify({**columns, "command": 1000.0 * columns["command"]})
        self.assertAlmostEqual(other.estimate["tau_s"] / one.estimate["tau_s"], 1.0, delta=1e-5)
        self.assertEqual(one.verdict.state, other.verdict.state)


if __name__ == "__main__":
    unittest.main()

"""Estimators whose data come one by one against the batch call."""
import copy
import pickle
import unittest

import numpy as np

import alidade as al
from common import BOARD, InFolder


class Live(InFolder):
    def test_tracker_has_the_path_of_track(self):
        made = al.simulate.track(scenario="C", seed=2)
        made.save(self.folder / "events")
        rig, events = self.folder / "events" / "rig.yaml", made.tables["events"]
        tracker = al.Tracker(rig, sigma_a_m_s2=1.0)
        for row in events:
            step = tracker.push(row["head"], (row["pan_rad"], row["tilt_rad"]), (row["u_px"], row["v_px"]),
                                row["t_capture_s"], row["t_arrival_s"])
        batch = al.track(events, rig=rig, sigma_a_m_s2=1.0)
        self.assertEqual(tracker.finish().estimate, batch.estimate)
        self.assertEqual(step["covariance"].shape, (6, 6))
        self.assertGreater(tracker.at(step["t_s"] + 0.1)["covariance"][0, 0], step["covariance"][0, 0])
        for wrong in (lambda: tracker.push(99, (0.0, 0.0), (0.0, 0.0), 0.0), lambda: al.Tracker("absent.yaml"),
                      lambda: tracker.push(1, (0.0,), (0.0, 0.0), 0.0), lambda: al.Tracker(rig, sigma_px=-1.0),
                      lambda: al.Tracker(rig, sigmas=1.0)):
            with self.assertRaises(ValueError):
                wrong()

    def test_what_takes_data_one_by_one_is_not_pickled_and_says_so(self):
        al.simulate.track(scenario="B", duration=1).save(self.folder / "few")
        for one in (al.Tracker(self.folder / "few" / "rig.yaml"), al.Observer((640, 480)), al.CaptureGuide(BOARD)):
            for work in (pickle.dumps, copy.copy, copy.deepcopy):
                with self.subTest(one=type(one).__name__, work=work.__name__), self.assertRaisesRegex(TypeError, "belongs to a stream: keep what finish"):
                    work(one)

    def test_observer_has_the_answer_of_observe(self):
        made = al.simulate.rotation(points=8, seed=3, duration=10)
        log = made.tables["log"]
        points = sum(name.startswith("p") and name.endswith("x") for name in log.dtype.names)
        observer = al.Observer(size=(780, 582))
        for row in log:
            turned = [row[name] for name in ("omega_x", "omega_y", "omega_z") if name in log.dtype.names]
            pixels = [[row[f"p{i + 1}x"], row[f"p{i + 1}y"]] for i in range(points)]
            step = observer.push(row["t"], turned, pixels)
        live, batch = observer.finish(), al.observe(log, size=(780, 582))
        self.assertEqual(live.estimate["camera"], batch.estimate["camera"])
        self.assertTrue(np.isfinite([step["fx"], step["sigma_fx"]]).all())
        for wrong in (lambda: observer.push(99.0, [0.0] * 5, pixels), lambda: observer.push(99.0, turned, pixels[:2]),
                      lambda: observer.push(99.0, turned[:2], pixels),
                      lambda: observer.push(99.0, turned, [[np.inf, 0.0], *pixels[1:]]),
                      lambda: observer.push(99.0, turned, [0.0, 1.0]), lambda: al.Observer(source="moon"),
                      lambda: al.Observer().finish()):
            with self.assertRaises(ValueError):
                wrong()

    def test_localizer_has_the_path_of_localize(self):
        made = al.simulate.underwater(frames=40)
        made.save(self.folder / "dive")
        files = {name: self.folder / "dive" / f"{name}.yaml" for name in ("camera", "target", "start")}
        batch = al.localize(made.tables["sights"], **files)
        localizer = al.Localizer(files["camera"], target=files["target"], start=files["start"])
        sights = made.tables["sights"]
        for frame in np.unique(sights["frame"]):
            seen = sights[sights["frame"] == frame]
            step = localizer.push(seen["t_s"][0], seen["point_id"], np.stack([seen["u_px"], seen["v_px"]], axis=1))
            if frame == 20:  # numbers of a column of floating ones; nothing seen is a frame, too
                other = al.Localizer(files["camera"], target=files["target"], start=files["start"])
                other.push(seen["t_s"][0], seen["point_id"].astype(float), np.stack([seen["u_px"], seen["v_px"]], axis=1))
                self.assertEqual(other.push(seen["t_s"][0] + 1.0, [], np.zeros((0, 2)))["frame"], 1)
                with self.assertRaises(ValueError):
                    other.push(99.0, [1.5], [[1.0, 2.0]])
        live = localizer.finish()
        self.assertEqual(live.estimate["frames"], batch.estimate["frames"])
        np.testing.assert_allclose(live.tables["trajectory"]["x_m"], batch.tables["trajectory"]["x_m"], atol=1e-9)
        self.assertEqual((step["position_m"].shape, step["covariance"].shape), ((3,), (6, 6)))
        with self.assertRaises(ValueError):
            localizer.push(99.0, [1, 2], [[1.0, 2.0]])
        with self.assertRaises(ValueError):
            localizer.push_image(99.0, np.zeros((4, 4)))

    def test_a_path_begins_in_the_map_of_an_earlier_one(self):
        made = al.simulate.underwater(frames=40, points=30)
        made.save(self.folder / "first")
        files = {name: self.folder / "first" / f"{name}.yaml" for name in ("camera", "target", "start")}
        first = al.localize(made.tables["sights"], **files)
        first.save(self.folder / "map")
        in_map = {"camera": files["camera"], "map": self.folder / "map" / "map.yaml"}
        again, localizer = al.localize(made.tables["sights"], **in_map), al.Localizer(**in_map)
        sights = made.tables["sights"]
        for frame in np.unique(sights["frame"]):
            seen = sights[sights["frame"] == frame]
            localizer.push(seen["t_s"][0], seen["point_id"], np.stack([seen["u_px"], seen["v_px"]], axis=1))
        for path in (again, localizer.finish()):
            self.assertTrue(path.estimate["scale_known"])
            np.testing.assert_allclose(path.tables["trajectory"]["x_m"], first.tables["trajectory"]["x_m"], atol=0.01)
        with self.assertRaises(ValueError):
            al.Localizer(target=files["target"], **in_map)


if __name__ == "__main__":
    unittest.main()

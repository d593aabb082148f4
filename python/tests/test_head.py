"""A simulated head from Python: asked, moved within its limits, identified, its camera calibrated."""
import math
import unittest

import alidade as al
from common import InFolder


class Heads(InFolder):
    def test_is_asked_and_not_moved(self):
        with al.Head("sim://?clock=free&min_pan=-60&max_pan=60") as head:
            self.assertAlmostEqual(head.limits["high_rad"][0], math.radians(60))
            self.assertEqual(head.limits["are_given"], head.limits["are_told"])  # its former name
            self.assertEqual(head.position()["pan_tilt_rad"], (0.0, 0.0))
            for wrong in (lambda: head.command((0.1, 0.0)), lambda: head.identify(), lambda: al.Head("sim://?speed=3"),
                          lambda: al.Head("rotctl://me:secret@127.0.0.1"), lambda: al.Head("sim://", password_file="absent"),
                          lambda: al.Head("sim://", move=True, pan_range_rad=(1, -1))):
                with self.assertRaises(ValueError) as raised:
                    wrong()
                self.assertNotIn("secret", str(raised.exception))
        with self.assertRaises(ValueError):
            head.position()

    def test_moves_within_its_limits(self):
        with al.Head("sim://?clock=free&latency=0", move=True, pan_range_rad=(-0.5, 0.5), tilt_range_rad=(0, 0.2)) as head:
            head.command((0.3, 0.1))
            for _ in range(100):
                at = head.position()
            self.assertAlmostEqual(at["pan_tilt_rad"][0], 0.3, delta=2e-4)
            for outside in ((0.6, 0.1), (0.3, -0.1), (math.nan, 0.0), (math.inf, 0.0)):
                with self.assertRaises(ValueError):
                    head.command(outside)

    def test_jobs(self):
        head = al.Head("sim://?rate=20&clock=free", move=True, pan_range_rad=(-1, 1), tilt_range_rad=(-0.3, 0.6))
        model = head.identify()
        self.assertAlmostEqual(model.estimate["axes"]["pan"]["rate_rad_s"], math.radians(20), delta=3e-3)
        camera = head.calibrate("sim://?delay=0.04", until="0.5%")
        self.assertEqual(camera.verdict.exit_code, 0)
        self.assertAlmostEqual(camera.estimate["camera"]["fx"] / 350.0, 1.0, delta=2e-3)


if __name__ == "__main__":
    unittest.main()

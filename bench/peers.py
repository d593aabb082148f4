"""What others need for the same work: OpenCV and mrcal as Debian packages them, timed by processor time.

As a program: peers.py mrcal FOLDER solves one case in a process of its own, and prints times and peak memory as JSON.
"""

import json
import pathlib
import sys
import time

import cv2
import numpy as np

try:
    import mrcal
except ImportError:  # a row without its peer is better than no table
    mrcal = None


class Case:
    """Corners that bench_case wrote, and our solution of them."""

    def __init__(self, name, folder, ours):
        self.cols, self.rows, self.photos = (int(n) for n in name.split("x"))
        self.ours = ours
        self.size = (int(ours["width"]), int(ours["height"]))
        self.square_m = ours["square_m"]
        folder = pathlib.Path(folder)
        self.corners = np.fromfile(folder / "corners.f64").reshape(self.photos, self.rows, self.cols, 2)
        self.poses = np.fromfile(folder / "poses.f64").reshape(self.photos, 6)


def timed(run):
    """Processor seconds of run(), and what it returns."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


def opencv_solve(case, flags=0):
    """cv2.calibrateCamera with its default criteria: seconds, and the solution."""
    grid = np.zeros((case.rows * case.cols, 3), np.float32)
    grid[:, :2] = np.mgrid[0 : case.cols, 0 : case.rows].T.reshape(-1, 2) * case.square_m
    # Single precision is what its Python interface takes; it moves no corner by more than 0.0001 px.
    seen = [photo.reshape(-1, 1, 2).astype(np.float32) for photo in case.corners]
    seconds, found = timed(
        lambda: cv2.calibrateCamera([grid] * case.photos, seen, case.size, None, None, flags=flags)
    )
    return seconds, {"rms_px": found[0], "fx": found[1][0, 0], "fy": found[1][1, 1], "cx": found[1][0, 2], "cy": found[1][1, 2]}


def mrcal_inputs(case, lens, intrinsics, poses):
    """Arguments of mrcal.optimize: one camera, flat board, neither regularisation nor outlier rejection, so that the
    optimum is everybody's."""
    observations = np.ones((case.photos, case.rows, case.cols, 3))
    observations[..., :2] = case.corners
    indices = np.full((case.photos, 3), -1, np.int32)
    indices[:, 0] = np.arange(case.photos)
    indices[:, 1] = 0
    return dict(
        intrinsics=intrinsics,
        extrinsics_rt_fromref=np.zeros((0, 6)),
        frames_rt_toref=poses,
        points=None,
        observations_board=observations,
        indices_frame_camintrinsics_camextrinsics=indices,
        observations_point=None,
        indices_point_camintrinsics_camextrinsics=None,
        lensmodel=lens,
        imagersizes=np.array([case.size], np.int32),
        calobject_warp=None,
        do_optimize_intrinsics_core=True,
        do_optimize_intrinsics_distortions=True,
        do_optimize_extrinsics=True,
        do_optimize_frames=True,
        do_optimize_calobject_warp=False,
        calibration_object_spacing=case.square_m,
        do_apply_outlier_rejection=False,
        do_apply_regularization=False,
        verbose=False,
    )


def mrcal_solution(case, inputs, stats):
    residuals = stats["x"][: 2 * case.corners[..., 0].size]
    fx, fy, cx, cy = inputs["intrinsics"][0, :4]
    rms_px = np.sqrt(2.0 * np.mean(residuals**2))
    return {"rms_px": rms_px, "fx": fx, "fy": fy, "cx": cx, "cy": cy}


def mrcal_seed(case):
    """The poses that mrcal-calibrate-cameras begins with, from a focal length 10 % off."""
    indices = np.zeros((case.photos, 2), np.int32)
    indices[:, 0] = np.arange(case.photos)
    observations = np.ones((case.photos, case.rows, case.cols, 3))
    observations[..., :2] = case.corners
    return mrcal.seed_stereographic(
        imagersizes=np.array([case.size], np.int32),
        focal_estimate=1.1 * case.ours["fx"],
        indices_frame_camera=indices,
        observations=observations,
        object_spacing=case.square_m,
    )


def mrcal_staged(case):
    """The stages of mrcal-calibrate-cameras: seed; poses; poses and pinhole core; everything.

    Seconds of the seed, seconds of the optimisations, solution, inputs of the last."""
    seed_s, (intrinsics, _, poses) = timed(lambda: mrcal_seed(case))

    def stages():
        inputs = mrcal_inputs(case, "LENSMODEL_STEREOGRAPHIC", intrinsics, poses)
        inputs["do_optimize_intrinsics_distortions"] = False
        mrcal.optimize(**{**inputs, "do_optimize_intrinsics_core": False})
        mrcal.optimize(**inputs)
        start = np.hstack([intrinsics, 1e-6 * (np.random.default_rng(1).random((1, 5)) - 0.5)])
        inputs = mrcal_inputs(case, "LENSMODEL_OPENCV5", start, poses)
        return inputs, mrcal.optimize(**inputs)

    solve_s, (inputs, stats) = timed(stages)
    return seed_s, solve_s, mrcal_solution(case, inputs, stats), inputs


def mrcal_from_ours(case):
    """mrcal.optimize started at our solution: the least it can take."""
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    intrinsics = np.array([[case.ours[name] for name in names]])
    inputs = mrcal_inputs(case, "LENSMODEL_OPENCV5", intrinsics, case.poses.copy())
    seconds, stats = timed(lambda: mrcal.optimize(**inputs))
    return seconds, mrcal_solution(case, inputs, stats)


def mrcal_sigma(inputs, cols=60, rows=40):
    """mrcal.projection_uncertainty over the image, at infinity: seconds, and σ of the worst direction."""
    model = mrcal.cameramodel(optimization_inputs=inputs, icam_intrinsics=0)
    width, height = model.imagersize()

    def run():
        u, v = np.meshgrid(np.linspace(0, width - 1, cols), np.linspace(0, height - 1, rows))
        rays = mrcal.unproject(np.dstack([u, v]), *model.intrinsics(), normalize=True)
        return mrcal.projection_uncertainty(rays, model=model, atinfinity=True, what="worstdirection-stdev")

    return timed(run)


def opencv_detect(photo, pattern=(9, 6)):
    """The tutorial's way: findChessboardCorners, then cornerSubPix (window 11). Seconds, whether found, corners."""

    def run():
        found, corners = cv2.findChessboardCorners(photo, pattern)
        if found:
            stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
            corners = cv2.cornerSubPix(photo, corners, (11, 11), (-1, -1), stop)
        return found, corners

    seconds, (found, corners) = timed(run)
    return seconds, found, corners


def opencv_detect_sectors(photo, pattern=(9, 6)):
    """findChessboardCornersSB with its accurate setting. Seconds, whether found."""
    seconds, (found, _) = timed(lambda: cv2.findChessboardCornersSB(photo, pattern, flags=cv2.CALIB_CB_ACCURACY))
    return seconds, found


def peak_kb():
    """Peak memory of this process, 0 where it cannot be determined."""
    for line in pathlib.Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1])
    return 0


def main():
    _, peer, name, folder = sys.argv
    assert peer == "mrcal"
    case = Case(name, folder, json.loads((pathlib.Path(folder) / "ours.json").read_text()))
    before_kb = peak_kb()
    seed_s, solve_s, solution, _ = mrcal_staged(case)
    answer = {"seed_s": seed_s, "solve_s": solve_s, "peak_kb": peak_kb(), "peak_before_kb": before_kb, **solution}
    answer["optimize_s"], _ = mrcal_from_ours(case)
    print(json.dumps(answer))


if __name__ == "__main__":
    main()

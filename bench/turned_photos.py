#!/usr/bin/python3
"""Focal length of a camera that was turned by hand: `alidade observe PHOTOS` beside OpenCV's stitching (cv2.detail).

bench/turned_photos.py ALIDADE FOLDER [FOLDER...]: a line a set, with the time of each. OpenCV's: SIFT, best of two
nearest, homographies, bundle adjustment on rays (one focal length per photo: their median is reported).
"""
import glob
import json
import subprocess
import sys
import time

import cv2
import numpy as np


def of_alidade(executable, photos):
    start = time.time()
    run = subprocess.run([executable, "observe", *photos, "--no-report", "--json", "--out", "/tmp/alidade-turned-photos"],
                         capture_output=True, text=True)
    seconds = time.time() - start
    if run.returncode not in (0, 6):
        return run.stderr.strip().splitlines()[-1], seconds
    result = json.loads(run.stdout)
    f, sigma = result["estimate"]["camera"]["fx"], result["stddev"]["camera"]["fx"]
    return f"f {f:.1f} ± {3 * sigma:.1f} px (3σ), {result['verdict']['state']}, {result['counts']['used']} photos", seconds


def of_opencv(photos, megapixels=1.6):
    start = time.time()
    images = [cv2.imread(p) for p in photos]
    scale = min(1.0, np.sqrt(megapixels * 1e6 / (images[0].shape[0] * images[0].shape[1])))
    finder = cv2.SIFT_create(2600)
    features = [cv2.detail.computeImageFeatures2(finder, cv2.resize(p, None, fx=scale, fy=scale)) for p in images]
    matcher = cv2.detail_BestOf2NearestMatcher(False, 0.65)
    matches = matcher.apply2(features)
    matcher.collectGarbage()
    kept = [int(i) for i in np.ravel(cv2.detail.leaveBiggestComponent(features, matches, 0.3))]
    features = [features[i] for i in kept]
    matches = matcher.apply2(features)
    ok, cameras = cv2.detail_HomographyBasedEstimator().apply(features, matches, None)
    if not ok:
        return "no estimate", time.time() - start
    for camera in cameras:
        camera.R = camera.R.astype(np.float32)
    adjuster = cv2.detail_BundleAdjusterRay()
    adjuster.setConfThresh(0.3)
    ok, cameras = adjuster.apply(features, matches, cameras)
    focal = np.array([camera.focal for camera in cameras]) / scale
    if not ok or not np.isfinite(focal).all():
        return "does not converge", time.time() - start
    return f"f {np.median(focal):.1f} px ({focal.min():.0f} to {focal.max():.0f}), {len(kept)} photos", time.time() - start


def main():
    executable, folders = sys.argv[1], sys.argv[2:]
    for folder in folders:
        photos = sorted(p for p in glob.glob(folder + "/*") if p.lower().endswith((".jpg", ".jpeg", ".png")))
        for name, (text, seconds) in {"alidade": of_alidade(executable, photos), "cv2.detail": of_opencv(photos)}.items():
            print(f"{folder}: {name:10} {text}; {seconds:.1f} s")


if __name__ == "__main__":
    main()

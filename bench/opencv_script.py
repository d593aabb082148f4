#!/usr/bin/env python3
"""What a newcomer writes: photos of a 9x6 board to a camera with OpenCV, no report: opencv_script.py PHOTO…"""

import sys

import cv2
import numpy as np


def calibrate(paths):
    grid = np.zeros((54, 3), np.float32)
    grid[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2)
    seen = []
    for path in paths:
        photo = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        found, corners = cv2.findChessboardCorners(photo, (9, 6))
        if found:
            stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
            seen.append(cv2.cornerSubPix(photo, corners, (11, 11), (-1, -1), stop))
    return cv2.calibrateCamera([grid] * len(seen), seen, photo.shape[::-1], None, None)


if __name__ == "__main__":
    rms, K, distortion, _, _ = calibrate(sys.argv[1:])
    print(rms, K, distortion)

#!/usr/bin/env python3
"""A camera calibrated while it looks at a board: webcam.py [NUMBER of the webcam | PATTERN of photos]."""
import glob
import sys

import cv2

import alidade as al

source = sys.argv[1] if len(sys.argv) > 1 else "0"
frames = (cv2.imread(name) for name in sorted(glob.glob(source))) if not source.isdigit() else None
webcam = cv2.VideoCapture(int(source)) if frames is None else None
finder = al.BoardFinder(al.Board("9x6", square_m=0.025))

while len(finder) < 25:
    image = webcam.read()[1] if webcam else next(frames, None)
    if image is None:
        break
    print(finder.push(image))
    if webcam:
        cv2.imshow("alidade", image)
        if cv2.waitKey(300) == 27:  # Esc; a moment to move the board
            break

result = al.calibrate(**finder.views())
print(result)
if result.verdict:
    result.save("webcam-result")

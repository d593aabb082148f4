#!/usr/bin/env python3
"""The focal length of a camera that turns, row by row: observe_live.py WIDTH HEIGHT < log.csv (t, rotation, p1x, p1y, …)."""
import csv
import sys

import numpy as np

import alidade as al

observer = al.Observer((int(sys.argv[1]), int(sys.argv[2])))
for number, row in enumerate(csv.DictReader(sys.stdin)):
    names = [n for n in ("pan", "tilt", "omega_x", "omega_y", "omega_z", "qw", "qx", "qy", "qz") if n in row]
    points = [[float(row[f"p{i}{axis}"] or "nan") for axis in "xy"] for i in range(1, 100) if f"p{i}x" in row]
    now = observer.push(float(row["t"]), [float(row[name]) for name in names], np.array(points))
    if number % 30 == 0:
        print(f"{now['t_s']:6.2f} s  fx {now['fx']:.1f} ± {3 * now['sigma_fx']:.1f} px (3σ)  {now['event']}")

print(observer.finish())

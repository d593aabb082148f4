#!/usr/bin/env python3
"""A target followed by pan-tilt heads, observation by observation: follow_target.py events.csv rig.yaml."""
import sys

import pandas

import alidade as al

tracker = al.Tracker(sys.argv[2])
for row in pandas.read_csv(sys.argv[1]).itertuples():  # or what your heads and your detector say, as it comes
    step = tracker.push(row.head, (row.pan_rad, row.tilt_rad), (row.u_px, row.v_px), row.t_capture_s, row.t_arrival_s)
    soon = tracker.at(row.t_arrival_s + 0.1)  # where it will be: what a servo aims at
    if soon and soon["position_m"] is not None and row.Index % 50 == 0:
        x, y, z = soon["position_m"]
        print(f"{soon['t_s']:6.2f} s  {x:7.3f} {y:7.3f} {z:7.3f} m  ± {3 * soon['covariance'][2, 2] ** 0.5:.3f} (3σ of z)")

print(tracker.finish())

#!/usr/bin/env python3
"""Where a camera is, frame by frame: where_am_i.py sights.csv camera.yaml target.yaml."""
import sys

import pandas

import alidade as al

localizer = al.Localizer(sys.argv[2], target=sys.argv[3])
for frame, seen in pandas.read_csv(sys.argv[1]).groupby("frame"):  # or localizer.push_image(t, image)
    step = localizer.push(seen["t_s"].iloc[0], seen["point_id"], seen[["u_px", "v_px"]])
    if step["position_m"] is not None and frame % 10 == 0:
        x, y, z = step["position_m"]
        print(f"{step['t_s']:6.2f} s  {x:7.3f} {y:7.3f} {z:7.3f} m  {step['event']}")

result = localizer.finish()
print(result)

#!/usr/bin/env python3
"""A log of a camera that turns, observed as it grows: observe_log.py log.csv WIDTH HEIGHT."""
import sys

import pandas

import alidade as al

file, size = sys.argv[1], (int(sys.argv[2]), int(sys.argv[3]))
log = pandas.read_csv(file)
for rows in range(len(log) // 4, len(log) + 1, max(1, len(log) // 4)):
    result = al.observe(log[:rows], size=size)  # a DataFrame with the columns of the CSV
    print(f"{log['t'].iloc[rows - 1]:6.1f} s  {result.verdict}")
    if result.verdict:
        print(f"          fx {result.camera.fx:.2f} ± {3 * result.camera.sigma.fx:.2f} px (3σ)")

last = pandas.DataFrame(result.tables["intrinsics"])
print(last.tail(3)[["t_s", "fx", "sigma_fx", "event"]])

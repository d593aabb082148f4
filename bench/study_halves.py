#!/usr/bin/env python3
"""Is σ what it says on real photos? Each set is split at random into two parts, both calibrated by `alidade calibrate`;
z = difference of a lens parameter over its σ, and `alidade camera diff` says at how many pixels the two cameras agree within
3σ. study_halves.py ALIDADE [SPLITS]: Markdown tables on stdout, exit 1 where a goal is missed. The data lie in the folder
that ALIDADE_DATA names; sets that are not there are left out, by name."""
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile

DATA = pathlib.Path(os.environ.get("ALIDADE_DATA", "")) / "data"
PARTS = (5, 8, 12, 18)


def sets():
    """Name, photos, options: what each set's README says of its board."""
    listed = [("Bouguet", "bouguet-example1/*.tif", "12x13", 0.03),
              ("Bouguet stereo, left", "bouguet-stereo5/left*.jpg", "9x6", 0.03),
              ("Bouguet stereo, right", "bouguet-stereo5/right*.jpg", "9x6", 0.03),
              ("udacity-wide", "udacity-wide/GOPR*.jpg", "8x6", 0.03),
              ("dome, air", "underwater-dome/air1100/*.png", "8x6", 0.03),
              ("lcct-laser3d", "lcct-laser3d/*.jpg", "7x5", 0.03),
              ("lidar1d-giubilato", "lidar1d-giubilato/images/*", "8x6", 0.0387)]
    for name, pattern, board, square in listed:
        photos = sorted(DATA.glob(pattern))
        if photos:
            yield name, photos, ["--board", board, "--square", str(square)]
        else:
            print(f"study_halves: no photos of {name}", file=sys.stderr)


def lens(alidade, photos, options, out):
    """Values, σ and the model's σ of the lens; None where the data could not tell."""
    run = subprocess.run([alidade, "calibrate", *photos, *options, "--out", out, "--no-report", "--quiet"],
                         capture_output=True, text=True)
    if run.returncode not in (0, 6):
        return None
    result = json.loads((out / "result.json").read_text())
    model = result.get("stddev_model", result["stddev"])
    return result["estimate"]["camera"], result["stddev"]["camera"], model["camera"]


def scores(a, b, which):
    """z of every parameter that both parts estimated."""
    for name, sigma in a[which].items():
        other = b[which].get(name)
        if sigma and other:
            yield (a[0][name] - b[0][name]) / math.hypot(sigma, other)


def pixels(alidade, a, b, out):
    """Difference of two cameras in its σ, pixel by pixel."""
    subprocess.run([alidade, "camera", "diff", a / "camera.yaml", b / "camera.yaml", "--out", out, "--no-report", "--quiet"],
                   check=True)
    grids = json.loads((out / "result.json").read_text())["grids"]
    return [value for value in grids["diff"]["in_sigmas"] if value is not None]


class Compared:
    """Pairs of disjoint parts of one set."""

    def __init__(self):
        self.stated, self.model, self.pixels, self.pairs, self.refused = [], [], [], 0, 0

    def add(self, alidade, photos, size, seed, options, folder):
        shuffled = photos[:]
        random.Random(seed).shuffle(shuffled)
        out = [folder / "a", folder / "b", folder / "diff"]
        found = [lens(alidade, part, options, out[i]) for i, part in enumerate((shuffled[:size], shuffled[size:2 * size]))]
        if None in found:
            self.refused += 1
            return
        self.pairs += 1
        self.stated += scores(*found, 1)
        self.model += scores(*found, 2)
        self.pixels += pixels(alidade, *out)

    def row(self):
        """Cells of a table, and whether the goals are met."""
        if not self.pairs:
            return f"| 0 | | | | | | {self.refused} |", True
        (rms, beyond), (model_rms, model_beyond) = summary(self.stated), summary(self.model)
        within = 100 * sum(value <= 3 for value in self.pixels) / len(self.pixels)
        is_met, agrees = 0.6 <= rms <= 1.4 and beyond <= 3.0, within >= 95.0
        return (f"| {self.pairs} | {model_rms:.2f} | {model_beyond:.0f} % | {rms:.2f} | {beyond:.1f} %{'' if is_met else ' (!)'} "
                f"| {within:.1f} %{'' if agrees else ' (!)'} | {self.refused} |"), is_met and agrees


def summary(z):
    beyond = 100 * sum(abs(value) > 3 for value in z) / len(z)
    return math.sqrt(sum(value * value for value in z) / len(z)), beyond


def print_head(first):
    print(f"| set | {first} | pairs | model's σ: RMS z | beyond 3σ | stated σ: RMS z | beyond 3σ | pixels within 3σ | refused |")
    print("|---|---|---|---|---|---|---|---|---|")


def main():
    alidade, splits = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 20
    met = True
    print("# Halves of real photos\n\n"
          f"Made by `make study` (`bench/study_halves.py build/release/alidade {splits}`, photos from `ALIDADE_DATA`). Each set "
          "is split\nat random into two halves; both are calibrated by `alidade calibrate` with its defaults, and "
          "z is the difference of a lens\nparameter in its σ, over all parameters and splits. A σ that a second, "
          "independent measurement confirms has RMS z near 1.\nGoals: 0.6 to 1.4, at most 3 % beyond 3σ. The model's σ "
          "is that for independent corner errors, which other tools state.\nPixels: where the two cameras see a point "
          "within 3σ of each other, by `alidade camera diff`; goal: 95 %.\n")
    print_head("photos")
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        for name, photos, options in sets():
            halves = Compared()
            for split in range(splits):
                halves.add(alidade, photos, len(photos) // 2, split, options, folder)
            cells, is_met = halves.row()
            met = met and is_met
            print(f"| {name} | {len(photos)} {cells}", flush=True)
        few = max(1, splits // 4)
        print(f"\n## Parts of few photos\n\nTwo disjoint parts with the same number of photos, if the set has enough; {few} pairs each.\n")
        print_head("photos of a part")
        for name, photos, options in sets():
            for size in (size for size in PARTS if 2 * size <= len(photos)):
                parts = Compared()
                for split in range(few):
                    parts.add(alidade, photos, size, 1000 + split, options, folder)
                print(f"| {name} | {size} {parts.row()[0]}", flush=True)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""The pages docs/studies*.md that `alidade study` makes: runs the studies, writes the pages, exit code 1 where a goal is missed.

    tools/studies.py build/release/alidade build/study [PAGE...] [--share 0.1]

--share: that part of the trials, for a look; then nothing is written into docs."""
import argparse
import json
import pathlib
import subprocess
import sys


class Goal:
    """What every point of a study has to hold; None: nothing is asked."""

    def __init__(self, ratio=None, one=None, two=None, three=None, begin=None, good_beyond_5=None):
        self.ratio, self.shares, self.begin, self.good_beyond_5 = ratio, {"1": one, "2": two, "3": three}, begin, good_beyond_5

    def is_met(self, point, means):
        if self.begin is not None and point.get("value", self.begin) < self.begin:
            return True
        inside = all(low <= means[k] <= high for k, (low, high) in ((k, share) for k, share in self.shares.items() if share))
        ratios = [one["rms_over_bound"] for one in point["quantities"].values()]
        low, high = self.ratio or (0, float("inf"))
        return inside and all(low <= ratio <= high for ratio in ratios) and (self.good_beyond_5 is None or point["good_beyond_5_sigma"] <= self.good_beyond_5)


NORMAL = dict(one=(0.64, 0.72), two=(0.93, 0.97))
SHARED = dict(two=(0.90, 0.98))  # errors that corners share: what σ has to cover of them

# A page: title, what it is about, and sections: a heading, what is said there, what its rows are (a label and the words of `alidade study`),
# the goal, and quantities whose median error is shown: a name, the quantities, a factor.
MAP = [f"map_{col}_{row}" for row in range(4) for col in range(5)]
BEAM = [("origin x y z [mm]", ["origin_x_m", "origin_y_m", "origin_z_m"], 1e3), ("direction [mrad]", ["direction_a_rad", "direction_b_rad"], 1e3)]
FEW = "calibrate --trials {} --scenes 0 --vary photos=5:17:4"
PAGES = {
    "studies": ("Calibration: does σ mean what it says?", """Simulated corners of a 9×6 board, photos of 640×480, normal noise of 0.1 px per coordinate, model `brown` with nine free parameters; the bound
includes the unknown poses. `map`: the σ map at 5 × 4 pixels from corner to corner, with each calibrated camera's error there after removing the implied rotation, along the
longest axis of its covariance.""", [
        ("Independent corner errors", "Goals: 68 ± 4, 95 ± 2 % inside 1, 2σ; RMS error at most 1.10 of the Cramér–Rao bound.",
         [("", "calibrate --trials 2400 --sigma-map")], Goal((0, 1.10), **NORMAL), []),
        ("Errors that the corners of a photo share", "Each photo has an additional smooth error field of its own, 0.1 px per term at the board's border. Goal: 90 to 98 % inside 2σ.",
         [("", "calibrate --trials 2400 --shared 0.1")], Goal(**SHARED), []),
        ("From five photos on", "Poses are drawn again for each calibration. Goals: 95 ± 2 % inside 2σ if corner errors are independent.",
         [("flat", FEW.format(800)), ("free", FEW.format(200) + " --board-shape free")], Goal(two=(0.93, 0.97)), []),
        ("From five photos on, with errors that corners share", "Goal: 90 to 98 % inside 2σ.",
         [("flat", FEW.format(800) + " --shared 0.1"), ("free", FEW.format(200) + " --board-shape free --shared 0.1")], Goal(**SHARED), [])]),
    "studies-observe": ("Observing a rotating camera: the bound, and what σ covers", "Each trial runs the whole job of `alidade observe` on 1 to 6 s at 30 Hz, with different points.", [
        ("", "Goals from 61 rows on (with fewer, the errors are not yet normal): RMS error at most 1.10 of the bound, 68 ± 4, 95 ± 2 % inside 1, 2σ.",
         [("", "observe --method hybrid --trials 2000 --noise 0.3162 --vary rows=31:181:30 --scenes 2000")], Goal((0, 1.10), **NORMAL, begin=61), [])]),
    "studies-rangefinder": ("A laser rangefinder: error against the number of shots, the bound, and what σ covers",
                            """Board 9×6 of 40 mm, corners 0.2 px, spot 0.3 px, readings 2 mm, 0.5–4 m, tilts 0–45°, lens known to 1.5, 1.5, 2, 2 px.
`all` refines lens, boards and beam together; `beam` keeps lens and boards fixed.""", [
        ("18 shots", "Goals: RMS error at most 1.10 of the bound, 68 ± 4, 95 ± 2 % inside 1, 2σ.",
         [(method, f"rangefinder --trials 2000 --method {method}") for method in ("joint", "spot", "plane")], Goal((0, 1.10), **NORMAL), BEAM),
        ("Against the number of shots", "",
         [(f"{method}, {refine}", f"rangefinder --trials 200 --method {method} --refine {refine} --vary shots={first}:30:6")
          for method, first in (("joint", 6), ("spot", 6), ("plane", 6)) for refine in ("all", "beam")], Goal(), BEAM),
        ("Few shots", "With planes alone, five shots are needed.", [("joint", "rangefinder --trials 1000 --vary shots=3:6:1"), ("spot", "rangefinder --trials 1000 --method spot --vary shots=3:6:1")], Goal(), BEAM)]),
    "studies-turned": ("Photos of a camera turned by hand", """f 850 to 2000 px, 5 to 14 photos of 1280 × 960; k1, centre, noise (0.2 to 1 px), rotations and points (at 2 to 20 m) are drawn again for each trial; each row has one
fault. Errors of f are relative.""", [
        ("Rotation on the spot", "`--on-the-spot`. Goals: 93 % inside 2σ, 97 % inside 3σ, none called good that is beyond 5σ.",
         [(label, f"turned --trials 200 --on-the-spot {words}".strip()) for label, words in (
             ("clean", ""), ("0.5 % wrong matches", "--wrong-matches 0.005"), ("30 % wrong matches", "--wrong-matches 0.3"), ("a quarter of the points moving", "--moving-points 0.25"))],
         Goal(two=(0.93, 1), three=(0.97, 1), good_beyond_5=0), [("f [%]", ["fx"], 100.0)]),
        ("By hand", "Goals: 97 % inside 3σ, none called good that is beyond 5σ.",
         [(label, f"turned --trials 200 {words}") for label, words in (
             ("lever of 5 mm", "--lever 0.005"), ("lever of 5 cm", "--lever 0.05"), ("lever of 20 cm", "--lever 0.2"), ("the hand steps by 1 cm", "--step 0.01"), ("focus walks by 0.3 %", "--focus 0.003"))],
         Goal(three=(0.97, 1), good_beyond_5=0), [("f [%]", ["fx"], 100.0)])]),
    "studies-chain": ("σ at the end of a chain", """Each trial calibrates every camera from 13 photos of a 9×6 board (640×480, 0.1 px), then the rig from 5 placements of the board seen by both heads (0.2 px, encoders 0.02°, their scales
estimated), and then tracks a target for 3 s (0.3 px, 0.02°, heads 0.5 m apart). The error is that of the last position. `exact`: the track takes rig and lenses as exact.""", [
        ("", "Goal: RMS error 0.84 to 1.14 of the stated σ for each axis at every range; `exact` shows the effect of ignoring the chain.",
         [("", "chain --trials 200 --vary range=1:13:4")], Goal((0.84, 1.14)), [("error x y z [mm]", ["x_m", "y_m", "z_m"], 1e3)]),
        ("Exact", "", [("", "chain --trials 200 --exact --vary range=1:13:4")], Goal(), [("error x y z [mm]", ["x_m", "y_m", "z_m"], 1e3)])]),
}


def run(alidade, words, folder, share):
    words = words.split()
    at = words.index("--trials") + 1
    words[at] = str(max(20, int(int(words[at]) * share)))
    subprocess.run([alidade, "study", *words, "--out", folder, "--no-report", "--quiet"], check=True)
    return json.loads((folder / "study.json").read_text())["estimate"]


def mean_inside(quantities):
    known = [one for one in quantities if one["values"] > 0]
    return {k: sum(one["coverage"][k] for one in known) / len(known) for k in "123"} if known else dict.fromkeys("123", float("nan"))


def percent(means):
    return f"{100 * means['1']:.1f} | {100 * means['2']:.1f} | {100 * means['3']:.2f}"


def number(value):
    return "–" if value is None else f"{value:.3g}"


def rows_by_quantity(estimate, goal):
    """A row per quantity; those of the σ map are one."""
    print("| | RMS error over the bound | RMS of σ over RMS error | inside 1σ [%] | 2σ | 3σ |\n|---|---|---|---|---|---|")
    quantities, met = estimate["quantities"], True
    names = [[name] for name in quantities if name not in MAP] + ([MAP] if MAP[0] in quantities else [])
    for group in names:
        figures = [quantities[name] for name in group]
        ratios = [one["rms_over_bound"] for one in figures]
        sigmas = [one["rms_sigma"] / one["rms"] for one in figures]
        means = mean_inside(figures)
        spread = lambda values: f"{values[0]:.3f}" if len(values) == 1 else f"{min(values):.3f} to {max(values):.3f}"
        print(f"| {group[0] if len(group) == 1 else f'map, {len(group)} pixels'} | {spread(ratios)} | {spread(sigmas)} | {percent(means)} |")
        if goal.shares["1"]:  # of each; elsewhere of all together
            met = met and goal.is_met({"quantities": dict(zip(group, figures)), "good_beyond_5_sigma": 0}, means)
    if goal.shares["1"] is None:
        met = goal.is_met(estimate, mean_inside(quantities.values()))
    lost = sum(quantities[name]["values"] for name in MAP) / (20 * estimate["estimates"]) if MAP[0] in quantities else 1
    print(f"\n{estimate['trials']} trials, {estimate['trials'] - estimate['estimates']} without an estimate."
          + (f" In {100 - 100 * lost:.2f} % of cases a pixel is outside the calibrated lens' valid domain, and no σ is claimed." if lost < 1 else ""))
    return met


def rows_by_point(label, estimate, goal, shown):
    points, met = estimate.get("curve", [estimate]), True
    for point in points:
        quantities, means = point["quantities"], mean_inside(point["quantities"].values())
        ratios = " ".join(number(one["rms_over_bound"]) for one in quantities.values())
        medians = "".join(" | " + " ".join(number(factor * quantities[name]["median"] if quantities[name]["values"] else None) for name in names) +
                          " (" + " ".join(number(factor * quantities[name]["p90"] if quantities[name]["values"] else None) for name in names) + ")" for _, names, factor in shown)
        at = f"{label}{', ' if label and 'value' in point else ''}" + (f"{point['value']:g}" if "value" in point else "")
        print(f"| {at} | {point['trials']} | {ratios} | {percent(means)}{medians} | {point['trials'] - point['estimates']} | {point['good_beyond_5_sigma']} |")
        met = met and goal.is_met(point, means)
    return met


def write_section(alidade, heading, text, rows, goal, shown, out, share):
    if heading:
        print(f"## {heading}\n")
    for _, words in rows:
        print(f"    alidade study {words}")
    print(f"\n{text}\n" if text else "")
    estimates = [(label, run(alidade, words, out / str(i), share)) for i, (label, words) in enumerate(rows)]
    if len(rows) == 1 and "curve" not in estimates[0][1]:
        met = rows_by_quantity(estimates[0][1], goal)
    else:
        first = estimates[0][1]
        names = " ".join(first.get("curve", [first])[0]["quantities"])
        medians = "".join(f" | {name}: median (90 %)" for name, _, _ in shown)
        print(f"| {first.get('varied', '')} | trials | RMS error over {'the bound' if first['bound'] == 'Cramér–Rao' else 'RMS of σ'}, {names} | inside 1σ [%] | 2σ | 3σ{medians} | without an estimate | good, beyond 5σ |")
        print("|---|---|---|---|---|---" + "|---" * len(shown) + "|---|---|")
        met = all([rows_by_point(label, estimate, goal, shown) for label, estimate in estimates])
    if vars(goal) != vars(Goal()):
        print(f"\nGoals {'met' if met else 'MISSED'}.")
    print(flush=True)
    return met


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("alidade", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("pages", nargs="*", default=list(PAGES))
    parser.add_argument("--share", type=float, default=1.0)
    args = parser.parse_args()
    met, console = True, sys.stdout
    for page in args.pages or PAGES:
        title, text, sections = PAGES[page]
        print(f"study: {title}", file=console, flush=True)
        folder = args.out / page
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / "page.md", "w") as sys.stdout:
            print(f"# {title}\n\nMade by `make study` (`tools/studies.py build/release/alidade build/study {page}`).\n\n{text}\n")
            met = all([write_section(args.alidade.resolve(), *section, folder, args.share) for section in sections]) and met
        sys.stdout = console
        if args.share == 1.0:
            docs = pathlib.Path(__file__).parent.parent / "docs"
            (docs / f"{page}.md").write_text((folder / "page.md").read_text().rstrip() + "\n")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Ours and the peers side by side, in one run on one machine: compare.py BUILD_FOLDER [--quick]

Ours and each peer take turns, and medians are compared, because other work on the machine slows all of them. Times are
processor time of all threads, unless the row says wall. Prints a table, and writes it to BUILD_FOLDER/../bench/bench.md.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import time

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[threads] = "1"  # idle threads of the peers' algebra would spin, and count

import cv2  # noqa: E402 (after the number of threads)

import opencv_script  # noqa: E402
import peers  # noqa: E402
from bench_table import Row, as_markdown, seconds_text  # noqa: E402

cv2.setNumThreads(1)
REPETITIONS = {20: 9, 100: 5, 500: 3, 2000: 2}
SOLVE_GOALS = {"9x6x20": 10, "9x6x100": 20, "9x6x500": 20, "9x6x2000": 20, "20x14x2000": 20}


class Ours:
    """Our benchmark programs."""

    def __init__(self, build, work, photos):
        self.build, self.work, self.photos = build, work, [str(p) for p in photos]

    def bench(self, name, min_time_s=0.1):
        """Processor seconds of one benchmark, in a process of its own."""
        command = [self.build / "calibrate_bench", *self.photos, f"--benchmark_filter=^{name}/process_time$"]
        command += ["--benchmark_format=json", f"--benchmark_min_time={min_time_s}"]
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        found = json.loads(run.stdout)["benchmarks"][0]
        if found.get("error_occurred"):
            raise RuntimeError(f"{name}: {found['error_message']}")
        return 1e-3 * found["cpu_time"]

    def solve(self, case):
        folder = self.work / case
        command = [self.build / "bench_case", "solve", case, folder]
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        (folder / "ours.json").write_text(run.stdout)
        return json.loads(run.stdout), folder


def say(text):
    print(f"bench: {text}", flush=True)


def agreement(ours, peer):
    worst = max(abs(ours[name] - peer[name]) for name in ("fx", "fy", "cx", "cy"))
    return f"RMS {abs(ours['rms_px'] - peer['rms_px']):.1e} px, fx fy cx cy {worst:.1e} px"


def solve_peers(name, case, folder):
    """One turn of mrcal: seconds by stage, and its solution. The largest case has a process of its own, for memory."""
    if name == "20x14x2000":
        command = [sys.executable, peers.__file__, "mrcal", name, folder]
        return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    seed_s, solve_s, solution, _ = peers.mrcal_staged(case)
    optimize_s, _ = peers.mrcal_from_ours(case)
    return {"seed_s": seed_s, "solve_s": solve_s, "optimize_s": optimize_s, **solution}


def solve_row(name, ours, agreements):
    say(f"solve {name}")
    solution, folder = ours.solve(name)
    case = peers.Case(name, folder, solution)
    own, turns = [], []
    for _ in range(1 if name == "20x14x2000" else REPETITIONS[case.photos]):
        own.append(ours.bench(f"calibrate/{name}"))
        if peers.mrcal:
            turns.append(solve_peers(name, case, folder))
    own.append(ours.bench(f"calibrate/{name}"))
    own_s = statistics.median(own)
    texts, ratio = [], None
    if turns:
        staged_s, seed_s, optimize_s = (statistics.median(t[key] for t in turns) for key in ("solve_s", "seed_s", "optimize_s"))
        texts.append(f"mrcal staged {seconds_text(seed_s + staged_s)} (of which seed {seconds_text(seed_s)})")
        texts.append(f"mrcal from our solution {seconds_text(optimize_s)}")
        ratio = (seed_s + staged_s) / own_s
        agreements.append((name, "mrcal", agreement(solution, turns[0])))
    for label, flags, most in (("default", 0, 20), ("LU", cv2.CALIB_USE_LU, 100)):
        if case.photos <= most:
            seconds, found = peers.opencv_solve(case, flags)
            texts.append(f"OpenCV {label} {seconds_text(seconds)}")
            agreements.append((name, f"OpenCV {label}", agreement(solution, found)))
    goal = SOLVE_GOALS[name]
    rows = [Row(f"solve {name}", texts, seconds_text(own_s), ratio, f"ratio ≥ {goal}", ratio and ratio >= goal)]
    if name == "20x14x2000":
        peak_mb = 1e-3 * solution["peak_kb"]
        theirs = [f"mrcal {1e-3 * turns[0]['peak_kb']:.0f} MB"] if turns else []
        rows.append(Row(f"solve {name}, absolute", [], seconds_text(own_s), None, "≤ 1 s", own_s <= 1.0))
        rows.append(Row(f"solve {name}, peak memory", theirs, f"{peak_mb:.0f} MB", None, "≤ 200 MB", peak_mb <= 200))
    return rows


def step_row(ours):
    own_s = ours.bench("linearize/9x6x100")
    return Row("one linearisation, 9x6x100", [], seconds_text(own_s), None, "", None)


def clusters_row(ours):
    """What it costs that the corners of a photo share errors: of the solve, in turns."""
    turns = [(ours.bench("clusters/9x6x100"), ours.bench("calibrate/9x6x100")) for _ in range(5)]
    own_s, solve_s = (statistics.median(column) for column in zip(*turns))
    share = own_s / solve_s
    return Row(f"clusters' covariance, 9x6x100: {100 * share:.1f} % of the solve", [], seconds_text(own_s), None,
               "≤ 10 %, ≤ 1 ms", share <= 0.1 and own_s <= 0.001)


def sigma_row(ours):
    say("σ map 60×40")
    own, theirs = [], []
    case = peers.Case("9x6x20", ours.work / "9x6x20", json.loads((ours.work / "9x6x20" / "ours.json").read_text()))
    inputs = peers.mrcal_staged(case)[3] if peers.mrcal else None
    for _ in range(5):
        own.append(ours.bench("projection_sigma/60x40"))
        if inputs:
            theirs.append(peers.mrcal_sigma(inputs)[0])
    own_s = statistics.median(own)
    texts = [f"mrcal {seconds_text(statistics.median(theirs))}"] if theirs else []
    ratio = statistics.median(theirs) / own_s if theirs else None
    return Row("σ map 60×40", texts, seconds_text(own_s), ratio, "≤ 10 ms", own_s <= 0.010)


def detect_row(label, paths, ours, goal_s):
    """Median over photos and three turns; ratio to the faster of OpenCV's detectors that found as much."""
    say(f"detection: {label}")
    own, plain, sectors, found = [], [], [], [0, 0]
    for path in paths:
        photo = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        for turn in range(3):
            own.append(ours.bench(f"find_board/{path.name}", 0.02))
            seconds, is_found, _ = peers.opencv_detect(photo)
            plain.append(seconds)
            seconds, is_found_by_sectors = peers.opencv_detect_sectors(photo)
            sectors.append(seconds)
        found[0] += is_found
        found[1] += is_found_by_sectors
    own_s, plain_s, sectors_s = (statistics.median(times) for times in (own, plain, sectors))
    texts = [f"OpenCV {seconds_text(plain_s)} (finds {found[0]} of {len(paths)})"]
    texts.append(f"OpenCV by sectors {seconds_text(sectors_s)} (finds {found[1]})")
    text = seconds_text(own_s) + (f" (worst photo {seconds_text(max(own))})" if len(paths) > 1 else "")
    return Row(f"detection, {label}", texts, text, plain_s / own_s, f"≤ {1e3 * goal_s:.0f} ms", own_s <= goal_s)


def wall(run):
    start = time.monotonic()
    run()
    return time.monotonic() - start


def report_row(label, paths, ours):
    say(f"13 photos to report ({label})")
    command = [ours.build / "alidade", "calibrate", *paths, "--board", "9x6", "--square", "0.025", "--quiet"]
    command += ["--out", ours.work / "report"]
    script = [sys.executable, pathlib.Path(opencv_script.__file__), *paths]
    own, theirs, inside = [], [], []
    for _ in range(5):
        own.append(wall(lambda: subprocess.run(command, capture_output=True, check=True)))
        theirs.append(wall(lambda: subprocess.run(script, capture_output=True, check=True)))
        inside.append(wall(lambda: opencv_script.calibrate(paths)))
    own_s, opencv_s = statistics.median(own), statistics.median(theirs)
    name = f"13 photos to report, {label}, wall"
    work_s = seconds_text(statistics.median(inside))
    texts = [f"OpenCV's script, no report {seconds_text(opencv_s)} (without starting Python, one thread {work_s})"]
    return Row(name, texts, seconds_text(own_s), opencv_s / own_s, "≤ 0.5 s, ratio ≥ 1", own_s <= min(0.5, opencv_s))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--real", type=pathlib.Path, help="folder of OpenCV's photos left01.jpg …")
    parser.add_argument("--quick", action="store_true", help="leave out the cases of 2000 photos")
    options = parser.parse_args()
    build = options.build.resolve()
    work = build.parent / "bench"
    real = sorted(options.real.glob("left*.jpg")) if options.real else []
    ours = Ours(build, work, real)
    subprocess.run([build / "bench_case", "photos", work / "photos"], check=True)
    if not peers.mrcal:
        say("python3-mrcal is missing: its columns stay empty")

    agreements, rows = [], []
    for name in SOLVE_GOALS:
        if not (options.quick and name.endswith("2000")):
            rows += solve_row(name, ours, agreements)
    rows += [step_row(ours), clusters_row(ours), sigma_row(ours)]
    photos = work / "photos"
    rows.append(detect_row("rendered VGA photos with a board", sorted(photos.glob("board_*.png")), ours, 0.010))
    if real:
        rows.append(detect_row("OpenCV's VGA photos with a board", real, ours, 0.010))
    rows.append(detect_row("megapixel photo without a board", [photos / "no_board.png"], ours, 0.060))
    rows.append(report_row("rendered", sorted(photos.glob("set_*.png")), ours))
    if real:
        rows.append(report_row("OpenCV's", real, ours))
    text = as_markdown(rows, agreements)
    (work / "bench.md").write_text(text)
    print(text)
    say(f"this table is in {os.path.relpath(work / 'bench.md')}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""What every command answers to every simulated scenario and to recorded data, kept and compared: for changes that must
not move a number.

    tools/keep_estimates.py keep ALIDADE FOLDER [WORD]      runs all cases (or those whose name holds WORD)
    tools/keep_estimates.py compare OLD NEW [--renamed NAME=NEW ...]

A case is kept as FOLDER/CASE.json: exit code and what result.json says of counts, estimate, σ, covariance, data and
grids, and the numbers of every CSV and TUM file. Numbers agree if they differ by 1e-12 of the larger one."""
import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SEEDS = range(1, 6)
KEPT = ("verdict", "counts", "assumed", "estimate", "stddev", "stddev_model", "covariance", "data", "grids")
RELATIVE = 1e-12


def simulated_cases():
    """(name, simulate words, [(name, command words)]): @ is the folder of what was simulated."""
    board = ["--board", "9x6", "--square", "0.025"]
    calibrate = ["calibrate", "--corners", "@/corners.csv", "--size", "800x600", *board]
    yield "board", ["board", "--corners-only", "--photos", "15", *board], [
        (f"{model}-{shape}", [*calibrate, "--model", model, "--board-shape", shape])
        for model in ("pinhole", "brown", "kannala_brandt") for shape in ("flat", "bow", "free")]
    yield "board-shared", ["board", "--corners-only", "--photos", "15", "--shared-px", "0.1", *board], [("", calibrate)]
    yield "board-photos", ["board", "--photos", "8", "--size", "640x480", *board], [("", ["calibrate", "@", *board])]
    for kind, extra in (("charuco", ["--marker", "0.018"]), ("circles", []), ("aprilgrid", ["--marker", "0.009"])):
        words = ["--board", "7x5", "--square", "0.03", "--target", kind, *extra]
        yield f"board-{kind}", ["board", "--photos", "6", "--size", "640x480", *words], [("", ["calibrate", "@", *words])]
    methods = ("hybrid", "batch", "window", "flow", "fang2011")
    for source in ("rate", "head", "attitude"):
        for zoom in ("none", "ramp", "step"):
            yield f"rotation-{source}-{zoom}", [
                "rotation", "--source", source, "--zoom", zoom, "--points", "12", "--duration", "10"], [
                (method, ["observe", "@/log.csv", "--size", "780x582", "--method", method]) for method in methods]
    for motion in ("pan", "tilt", "roll", "still"):
        yield f"rotation-{motion}", ["rotation", "--motion", motion, "--duration", "5"], [
            ("", ["observe", "@/log.csv", "--size", "780x582"])]
    yield "rotation-lens", ["rotation", "--source", "head", "--tilt-deg", "20", "--k1", "-0.2", "--points", "20"], [
        (name, ["observe", "@/log.csv", "--size", "780x582", *words]) for name, words in (
            ("k1", ["--estimate", "k1"]), ("auto", []), ("free", ["--rotation", "free"]))]
    for scenario in ("reference", "table1", "parallel", "frontal", "near_frontal", "equal_range", "short_span",
                     "through_centre", "parallel_to_view", "toed_in", "inverse_range", "four_shots"):
        words = ["rangefinder", "@/shots.csv", "--camera", "@/camera.yaml", "--corners", "@/corners.csv", "--board",
                 "9x6", "--square", "0.04"]
        yield f"rangefinder-{scenario}", ["rangefinder", "--scenario", scenario], [
            (method, [*words, "--method", method]) for method in ("joint", "plane", "spot")]
    for scenario in ("reference", "pan_only", "tilt_only", "unlinked", "one_head"):
        cameras = ["--camera", "@/camera_1.yaml"]
        if scenario != "one_head":
            cameras += ["--camera", "@/camera_2.yaml"]
        yield f"rig-{scenario}", ["rig", "--scenario", scenario], [("", ["rig", "@/views.csv", *cameras, *board])]
    for scenario in ("A", "A2", "B", "C", "D", "E", "F", "G"):
        words = ["track", "@/events.csv", "--rig", "@/rig.yaml", "--truth", "@/truth.csv"]
        yield f"track-{scenario}", ["track", "--scenario", scenario], [("", words), ("imm", [*words, "--method", "imm"]),
            ("paper", [*words, "--method", "xiahou2015"])]
    words = ["localize", "@/sights.csv", "--camera", "@/camera.yaml", "--truth", "@/truth.tum"]
    yield "underwater", ["underwater", "--points", "20", "--frames", "90", "--rate", "30"], [
        ("target", [*words, "--target", "@/target.yaml"]),
        ("start", [*words, "--target", "@/target.yaml", "--start", "@/start.yaml"]), ("alone", words)]
    yield "underwater-mismatches", ["underwater", "--points", "30", "--frames", "90", "--mismatches", "0.3"], [
        ("", [*words, "--target", "@/target.yaml"])]
    for kind in ("angle", "rate"):
        yield f"servo-{kind}", ["servo", "--kind", kind], [
            ("identify", ["identify", "@/log.csv"]), ("servo", ["servo", "@/scenario.yaml"])]
        yield f"servo-{kind}-chirp", ["servo", "--kind", kind, "--chirp"], [("", ["identify", "@/log.csv"])]


def real_cases(data):
    """(name, command words) on recorded data."""
    def photos(folder, pattern):
        return sorted((data / folder).glob(pattern))

    yield "real-left", ["calibrate", *photos("bouguet-stereo5", "**/left*.jpg"), "--board", "9x6", "--square", "0.025"]
    yield "real-right", ["calibrate", *photos("bouguet-stereo5", "**/right*.jpg"), "--board", "9x6", "--square", "0.025"]
    yield "real-bouguet", ["calibrate", *photos("bouguet-example1", "**/Image*.tif"), "--board", "13x12", "--square",
                           "0.03"]
    yield "real-udacity", ["calibrate", *photos("udacity-wide", "**/*.jpg"), "--board", "8x6", "--square", "0.1"]
    for paper in ("fang2011", "wang2020", "xiahou2015", "xu-underwater"):
        yield f"reproduce-{paper}", ["reproduce", paper]


def numbers_of(file):
    """Header and cells of a table, numbers as such."""
    def value_of(cell):
        try:
            return float(cell)
        except ValueError:
            return cell

    return [[value_of(cell) for cell in re.split(r"[,\s]+", line.strip())] for line in file.read_text().splitlines()]


def answer_of(alidade, words, out):
    run = subprocess.run([alidade, *map(str, words), "--out", out, "--no-report", "--quiet", "--threads", "1"],
                         capture_output=True, text=True)
    place = out if (out / "result.json").exists() else out / "refused"
    answer = {"exit_code": run.returncode, "stderr": run.stderr.replace(str(out.parent), "@")}
    if (place / "result.json").exists():
        result = json.loads((place / "result.json").read_text())
        answer["result"] = {name: result.get(name) for name in KEPT}
    answer["tables"] = {file.name: numbers_of(file) for file in sorted(place.glob("*"))
                        if file.suffix in (".csv", ".tum")}
    return answer


def keep(alidade, folder, word):
    folder.mkdir(parents=True, exist_ok=True)

    def write(name, answer):
        (folder / f"{name}.json").write_text(json.dumps(answer))

    def run_simulated(name, seed, simulate, commands):
        chosen = [(f"{name}-{seed}-{part}".rstrip("-"), words) for part, words in commands]
        if word and not any(word in case for case, _ in chosen):
            return
        with tempfile.TemporaryDirectory() as temporary:
            world = pathlib.Path(temporary) / "world"
            answer = answer_of(alidade, ["simulate", *simulate, "--seed", seed], world)
            write(f"simulate-{name}-{seed}", answer)
            for case, words in chosen:
                words = [word.replace("@", str(world)) for word in words]
                write(case, answer_of(alidade, words, pathlib.Path(temporary) / case))

    def run_real(name, words):
        if not word or word in name:
            with tempfile.TemporaryDirectory() as temporary:
                write(name, answer_of(alidade, words, pathlib.Path(temporary) / "out"))

    data = pathlib.Path(os.environ["ALIDADE_DATA"]) / "data" if os.environ.get("ALIDADE_DATA") else None
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = [pool.submit(run_simulated, name, seed, simulate, commands)
                for name, simulate, commands in simulated_cases() for seed in SEEDS]
        if data:
            jobs += [pool.submit(run_real, *case) for case in real_cases(data)]
        for job in jobs:
            job.result()
    print(f"{len(list(folder.glob('*.json')))} cases in {folder}")


def differences(old, new, renamed, where=""):
    """Lines that say where two kept answers differ."""
    if isinstance(old, dict) and isinstance(new, dict):
        old = {renamed.get(name, name): value for name, value in old.items()}
        for name in sorted(old.keys() | new.keys()):
            if name not in old or name not in new:
                yield f"{where}/{name}: only in the {'new' if name in new else 'old'}"
            else:
                yield from differences(old[name], new[name], renamed, f"{where}/{name}")
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{where}: {len(old)} and {len(new)} long"
        for i, (a, b) in enumerate(zip(old, new)):
            yield from differences(a, b, renamed, f"{where}[{i}]")
    elif isinstance(old, float) or isinstance(new, float):
        is_number = all(isinstance(v, (int, float)) for v in (old, new))
        is_nan = is_number and old != old and new != new
        if not is_nan and (not is_number or not abs(old - new) <= RELATIVE * max(abs(old), abs(new))):
            yield f"{where}: {old} {new}"
    elif old != new and renamed.get(old, old) != new:
        yield f"{where}: {old!r} {new!r}"


def compare(old, new, renamed, shown=5):
    cases = sorted({file.name for folder in (old, new) for file in folder.glob("*.json")})
    count = 0
    for case in cases:
        if not (old / case).exists() or not (new / case).exists():
            lines = [f"only in {old if (old / case).exists() else new}"]
        else:
            lines = list(differences(*(json.loads((folder / case).read_text()) for folder in (old, new)), renamed))
        if lines:
            count += 1
            print(f"{case}: {len(lines)} differ", *lines[:shown], sep="\n  ")
    print(f"{count} of {len(cases)} cases differ")
    return count


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    keeping = commands.add_parser("keep")
    keeping.add_argument("alidade")
    keeping.add_argument("folder", type=pathlib.Path)
    keeping.add_argument("word", nargs="?", default="")
    comparing = commands.add_parser("compare")
    comparing.add_argument("old", type=pathlib.Path)
    comparing.add_argument("new", type=pathlib.Path)
    comparing.add_argument("--renamed", action="append", default=[])
    args = parser.parse_args()
    if args.command == "keep":
        keep(args.alidade, args.folder, args.word)
        return 0
    return 1 if compare(args.old, args.new, dict(pair.split("=") for pair in args.renamed)) else 0


if __name__ == "__main__":
    sys.exit(main())

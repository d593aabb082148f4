#!/usr/bin/env python3
"""Runs the commands of docs/tour as a newcomer would, and compares what they print: tour_test.py ALIDADE [DOCS/TOUR]

In ```console blocks, `$ ` begins a command and what follows is its output, `…` any lines. Words must be the same. A number
with ± may differ by it, any other with a point by a quarter, a whole one not at all. A command ends with 0, or with what
`$ echo $?` shows behind it. At last the camera is held against the truth that the tour shows."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.]*\w)")
ESTIMATE = re.compile(r"^\s*(\w+)\s+(-?[\d.]+) ± ([\d.]+)", re.MULTILINE)
TRUTH = re.compile(r"^\s+(\w+)\s+(-?[\d.]+)(?: px)?$", re.MULTILINE)
QUARTER = 0.25


def steps(page):
    """[command, expected output lines, expected exit code] of a page, in order."""
    found = []
    for block in re.findall(r"^```console\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        lines, asks = block.splitlines(), False
        for line in lines:
            if line == "$ echo $?":
                asks = True
            elif line.startswith("$ "):
                found.append([line[2:], [], 0])
            elif asks:
                found[-1][2], asks = int(line), False
            else:
                found[-1][1].append(line)
    return found


def is_close(page, real):
    """Do two lines with the same words have numbers that agree?"""
    a, b = list(NUMBER.finditer(page)), list(NUMBER.finditer(real))
    for x, y in zip(a, b):
        want, got = float(x[0]), float(y[0])
        bound = re.match(r" ± ([\d.]+)", page[x.end():])
        if bound:
            allowed = float(bound[1])
        else:
            allowed = QUARTER * abs(want) if "." in x[0] or "e" in x[0] or page[:x.start()].endswith("± ") else 0.0
        if abs(got - want) > allowed:
            return False
    return True


def missing_line(expected, real):
    """The first expected line that does not come, in order; None where all do."""
    words = [NUMBER.sub("#", line) for line in real]
    at, may_skip = 0, False
    for line in expected:
        if line == "…":
            may_skip = True
            continue
        places = range(at, len(real) if may_skip else min(at + 1, len(real)))
        hit = next((i for i in places if words[i] == NUMBER.sub("#", line) and is_close(line, real[i])), None)
        if hit is None:
            return line
        at, may_skip = hit + 1, False
    return None if may_skip or at == len(real) else f"(nothing, but there is: {real[at]})"


def truth_faults(outputs):
    """Where the calibration's ± does not hold the truth; a fault as well if nothing could be compared."""
    calibrated = next(text for command, text in outputs if command.startswith("alidade calibrate photos "))
    shown = next(text for command, text in outputs if "camera show photos/truth_camera.yaml" in command)
    truth = {name: float(value) for name, value in TRUTH.findall(shown)}
    estimates = [(n, float(v), float(w)) for n, v, w in ESTIMATE.findall(calibrated) if n in truth]
    faults = [f"{n}: {v} ± {w} does not hold {truth[n]}" for n, v, w in estimates if abs(v - truth[n]) > w]
    located = next(text for command, text in outputs if "--truth dive/truth.tum" in command)
    ate_m, claimed_m = (float(re.search(p, located)[1]) for p in (r"ATE ([\d.e-]+) m", r"within ± ([\d.e-]+) m"))
    if ate_m > claimed_m:
        faults.append(f"ATE {ate_m} m is beyond the 3σ of {claimed_m} m")
    return faults if len(estimates) == 9 else faults + [f"{len(estimates)} of 9 values compared"]


def main(alidade, pages):
    env = {**os.environ, "PATH": f"{pathlib.Path(alidade).resolve().parent}:{os.environ['PATH']}", "LC_ALL": "C.UTF-8"}
    faults, outputs = [], []
    with tempfile.TemporaryDirectory() as folder:
        for page in sorted(pages.glob("[0-9]*.md")):
            for command, expected, code in steps(page.read_text()):
                ran = subprocess.run(["bash", "-o", "pipefail", "-c", command], cwd=folder, env=env, text=True,
                                     stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
                outputs.append((command, ran.stdout))
                if ran.returncode != code:
                    faults.append(f"{page.name}: exit {ran.returncode}, not {code}: {command}\n{ran.stdout}")
                missing = missing_line(expected, ran.stdout.splitlines())
                if missing:
                    faults.append(f"{page.name}: {command}\n  does not print: {missing}\n  but:\n{ran.stdout}")
    faults += truth_faults(outputs) if not faults else []
    print("\n".join(faults) or f"tour ok ({len(outputs)} commands)")
    return bool(faults) or len(outputs) < 10


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else "docs/tour")))

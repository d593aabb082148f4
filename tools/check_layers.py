#!/usr/bin/env python3
"""Fails if a folder includes a folder it may not. The table below IS the architecture: docs quote it, a test runs it."""
import pathlib
import re
import sys

FOUNDATIONS = {"geometry", "estimation"}
SENSORS = {"camera", "board", "imaging"}
ESTIMATORS = {"calibrate"}

MAY_INCLUDE = {
    "geometry": set(),
    "estimation": set(),
    "camera": FOUNDATIONS,
    "board": FOUNDATIONS | {"camera"},
    "imaging": FOUNDATIONS | {"camera", "board"},
    "simulate": FOUNDATIONS | SENSORS,
    **{estimator: FOUNDATIONS | SENSORS for estimator in ESTIMATORS},
    "report": FOUNDATIONS | SENSORS | ESTIMATORS | {"simulate"},
    "io": FOUNDATIONS | SENSORS | ESTIMATORS | {"simulate", "report"},
    "testing": FOUNDATIONS | SENSORS | ESTIMATORS | {"simulate", "report", "io"},
}
TESTS_MAY_ALSO = {"testing", "simulate", "io"}
HEAVY = re.compile(r'#include [<"](ceres|opencv2|nlohmann|yaml-cpp|tbb)/')
INCLUDE = re.compile(r'#include "alidade/(\w+)/')


def faults_of(file, folder, is_test):
    """Every forbidden include of one file, as `file:line: what`."""
    if folder not in MAY_INCLUDE:
        return [f"{file}: folder '{folder}' is not in the table"]
    allowed = MAY_INCLUDE[folder] | {folder} | (TESTS_MAY_ALSO if is_test else set())
    found = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        target = INCLUDE.match(line)
        if target and target[1] not in allowed:
            found.append(f"{file}:{number}: {folder}/ may not include {target[1]}/")
        heavy = HEAVY.match(line)
        if heavy and file.suffix == ".h" and folder != "testing":
            found.append(f"{file}:{number}: {heavy[1]} belongs in a .cpp")
    return found


def main(root):
    faults, files = [], sorted(root.rglob("*.[hc]*"))
    for file in files:
        faults += faults_of(file, file.relative_to(root).parts[0], file.stem.endswith("_test"))
    print("\n".join(faults) or f"layers ok ({len(files)} files)")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))

#!/usr/bin/env python3
"""Compiles every unit of a build once more, for its warnings alone, which are errors: check_warnings.py BUILD [FILE ...]
With files: only the units that hold one of them. Nothing is written; takes half of a build's time."""
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys

WARNINGS = ("-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Werror "
            # -Wshadow is for the preset dev: in a unit of several files it sees names of other files
            # of clang alone: lambdas in tests, `#pragma once` and static functions in a unit of several files
            "-Wno-unused-function -Wno-unused-const-variable -Wno-unused-private-field").split()


def units(build, files):
    """(name, words, folder) of the units to look at."""
    for entry in json.loads((build / "compile_commands.json").read_text()):
        unit = pathlib.Path(entry["file"])
        if unit.suffix != ".cpp" and unit.suffix != ".cxx" or "cmake_pch" in unit.name or "/_deps/" in str(unit):
            continue
        held = {str(unit)} | set(re.findall(r'#include "([^"]+\.cpp)"', unit.read_text()))
        if files and not any(str(pathlib.Path(file).resolve()) in held for file in files):
            continue
        words = shlex.split(entry["command"])
        words = words[next(i for i, word in enumerate(words) if re.search(r"(clang|g)\+\+[-\d]*$", word)):]  # no launcher
        at = words.index("-o")
        yield unit.name, [w for i, w in enumerate(words) if i not in (at, at + 1) and w != "-c"], entry["directory"]


def faults_of(unit):
    name, words, folder = unit
    done = subprocess.run([*words, "-fsyntax-only", *WARNINGS], cwd=folder, capture_output=True, text=True)
    return name, done.returncode, done.stderr


def main(build, files):
    chosen = list(units(build, files))
    bad = 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for name, code, said in pool.map(faults_of, chosen):
            if code != 0:
                bad += 1
                print(f"{name}:\n{said}")
    print(f"warnings: {bad} of {len(chosen)} units have some" if bad else f"no warnings in {len(chosen)} units")
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]), sys.argv[2:]))

#!/usr/bin/env python3
"""Fails if a folder includes a folder it may not. The table below IS the architecture: docs quote it, a test runs it."""
import collections
import pathlib
import re
import sys

FOUNDATIONS = {"geometry", "estimation", "description"}
VISION = {"imaging", "corners", "board_detector", "spot", "patches", "target", "matching"}  # measurements in an image
SENSORS = {"camera", "pantilt", "beam", "board", "imu"} | VISION
ESTIMATORS = {"calibrate", "localize", "network", "observe", "rangefinder", "rig", "servo", "track", "turned"}
COMPOSITIONS = {"capture", "fleet", "loop", "study"}  # put estimators and the simulator together
JOBS = FOUNDATIONS | SENSORS | ESTIMATORS | COMPOSITIONS | {"simulate"}
FILES = {"files", "images", "formats", "tables"}  # what stands on a disk, read and written

MAY_INCLUDE = {
    "geometry": set(),
    "estimation": set(),
    "description": set(),
    "camera": FOUNDATIONS,
    "pantilt": FOUNDATIONS | {"camera", "board"},
    "board": FOUNDATIONS | {"camera"},
    "beam": FOUNDATIONS | {"camera", "board"},
    "imu": FOUNDATIONS,
    "imaging": FOUNDATIONS | {"camera", "board"},
    "corners": FOUNDATIONS | {"imaging"},
    "board_detector": FOUNDATIONS | {"camera", "board", "imaging", "corners"},
    "spot": FOUNDATIONS | {"camera", "board", "imaging"},
    "patches": FOUNDATIONS | {"camera", "imaging"},
    "target": FOUNDATIONS | {"camera", "board", "imaging"},
    "matching": FOUNDATIONS | {"imaging"},
    "simulate": FOUNDATIONS | SENSORS,
    **{estimator: FOUNDATIONS | SENSORS for estimator in ESTIMATORS},
    "turned": FOUNDATIONS | SENSORS | {"observe"},  # what photos of a rotating camera tell is an observation
    **{composition: FOUNDATIONS | SENSORS | ESTIMATORS | {"simulate"} for composition in COMPOSITIONS},
    "reproduce": JOBS,
    "study": JOBS | {"reproduce"},  # the settings of the papers are settings to study
    "report": JOBS,
    "files": FOUNDATIONS,
    "images": FOUNDATIONS | {"imaging", "files"},
    "formats": JOBS | {"files"},
    "tables": JOBS | {"files", "formats"},
    "detect": JOBS | FILES,
    "heads": JOBS | FILES | {"detect"},  # devices that turn, and what is done with them
    "results": JOBS | FILES | {"reproduce", "report", "detect", "heads"},
    "reference": FOUNDATIONS | FILES,
    "live": JOBS | FILES | {"report", "results"},
    "testing": JOBS | FILES | {"reproduce", "report", "detect", "results"},
}
# What stands outside the library, by folder of the tree: folders of the library that it may include (None: all), and
# other folders of the tree. The library includes none of them.
OUTSIDE = {
    "cli": (set(), {"cli/app", "cli/commands"}),  # main.cpp
    "cli/app": ({"board", "calibrate", "description", "estimation", "files", "geometry", "images", "live", "report", "results"}, {"cli/app"}),
    "cli/commands": (None, {"cli/app", "cli/commands"}),
    "cli/simulate": (None, {"cli/app", "cli/commands", "cli/simulate"}),
    "cli/decoder": (set(), set()),  # programs of their own: videos; campaigns on MPI; fleets on NATS; streams of cameras
    "cli/ranks": (None, {"cli/app", "cli/commands", "cli/ranks"}),
    "cli/fleet": (None, {"cli/app", "cli/commands", "cli/fleet"}),
    "cli/heads": (None, {"cli/app", "cli/commands", "cli/heads"}),
    "cli/capture": (None, {"cli/app", "cli/commands", "cli/capture"}),
    "bench": (None, {"bench"}),
    "fuzz": (None, {"fuzz"}),
    "python/bindings": (None, {"cli/app", "cli/commands", "python/bindings"}),
    "examples": (set(), set()),  # what others see: public headers alone
}
# A room's public header and the job behind it, src/alidade/ROOM.h and .cpp, may include what the room may, and other
# public headers; `files` is theirs who read and write, `alidade` all of them.
# A job whose room is called otherwise: the room that it is of.
FACES_OF = {"identify": MAY_INCLUDE["servo"] | {"servo"}, "servo": MAY_INCLUDE["loop"] | {"loop"},
            "project": FOUNDATIONS | SENSORS | {"track"},  # how well rays meet stands there
            "files": {"results"} | MAY_INCLUDE["results"], "alidade": set(), "public": set()}
TESTS_MAY_ALSO = {"testing", "simulate", "detect", "results"} | FILES
INCLUDE = re.compile(r'#include "alidade/(\w+)/')
# A public header speaks Eigen and std: these cost seconds in every file that sees them.
HEAVY = re.compile(r'#include [<"](ceres|opencv2|nlohmann|yaml-cpp|tbb|fmt|boost)/')
# Only FILES and results/ open files, only live/ listens, only heads/ speaks to devices; nothing else in the library prints, starts threads or looks at a clock or the
# environment.
OUTSIDE_WORLD = re.compile(
    r"#include <(iostream|fstream|thread|chrono|ctime|unistd\.h)>|\b(f?printf|puts|fopen|getenv|imread|imwrite)\(")
PUBLIC_HEADERS_A_FOLDER = 12  # those that other folders include: what one has to know of it
HEADERS_A_FOLDER = 12  # a folder fits on one screen of `ls`
MORE_HEADERS_BECAUSE = {".": "one per room, its public face", "camera": "one per lens model, and what all of them share",
                        "results": "one outcome per job", "testing": "what tests share is not part of the library"}
LINES_A_FILE = 400


def allowed_by(file, folder):
    """The folders that a file may include; None where its place is not in the table."""
    if folder == file.name:  # src/alidade/ROOM.h
        room = file.stem.removesuffix("_test")
        return FACES_OF.get(room) if room in FACES_OF else MAY_INCLUDE.get(room) and MAY_INCLUDE[room] | {room}
    return MAY_INCLUDE[folder] | {folder} if folder in MAY_INCLUDE else None


def faults_of(file, folder):
    """Everything forbidden in one file, as `file:line: what`."""
    allowed = allowed_by(file, folder)
    if allowed is None:
        return [f"{file}: folder '{folder.removesuffix(file.suffix)}' is not in the table"]
    is_test = file.stem.endswith("_test") or folder == "testing"
    allowed = allowed | (TESTS_MAY_ALSO if is_test else set())
    found, lines = [], file.read_text().splitlines()
    for number, line in enumerate(lines, 1):
        target = INCLUDE.match(line)
        if target and target[1] not in allowed:
            found.append(f"{file}:{number}: {folder}/ may not include {target[1]}/")
        heavy = HEAVY.match(line)
        if heavy and file.suffix == ".h" and not is_test:
            found.append(f"{file}:{number}: {heavy[1]} belongs in a .cpp")
        outside = OUTSIDE_WORLD.search(line.split("//")[0])
        if outside and folder not in FILES | {"detect", "results", "live", "heads"} and not is_test:
            found.append(f"{file}:{number}: only what reads and writes, live/ and cli/ may use {outside[1] or outside[2]}")
    if len(lines) > LINES_A_FILE:
        found.append(f"{file}: {len(lines)} lines; a file has at most {LINES_A_FILE}")
    return found


def outside_faults(tree):
    """What the folders around the library may not include, and files of theirs that are too long."""
    found = []
    folders = {path.parent for path in tree.rglob("*") if path.suffix in {".h", ".cpp"}} if tree.is_dir() else set()
    for folder in sorted(folders):
        name = folder.relative_to(tree).as_posix()
        top = name.split("/")[0]
        if top in {"build", "src"} or "node_modules" in folder.parts:
            continue
        if name not in OUTSIDE:
            found.append(f"{name}/: is not in the table OUTSIDE")
            continue
        rooms, others = OUTSIDE[name]
        for file in sorted(path for path in folder.iterdir() if path.suffix in {".h", ".cpp"}):
            is_test = file.stem.endswith("_test")
            lines = file.read_text().splitlines()
            for number, line in enumerate(lines, 1):
                room, other = INCLUDE.match(line), re.match(r'#include "((?:cli|bench|fuzz|python|examples)[\w/]*)/[^/"]+"', line)
                if room and rooms is not None and room[1] not in rooms and not is_test:
                    found.append(f"{name}/{file.name}:{number}: {name}/ may not include alidade/{room[1]}/")
                if other and other[1] not in others and not is_test:
                    found.append(f"{name}/{file.name}:{number}: {name}/ may not include {other[1]}/")
            if len(lines) > LINES_A_FILE:
                found.append(f"{name}/{file.name}: {len(lines)} lines; a file has at most {LINES_A_FILE}")
    return found


def surface_of(files, root):
    """{folder: its headers that files of other folders include}. Tests may look closer."""
    surface = {}
    for file in files:
        if file.name.endswith("_test.cpp"):
            continue
        room = pathlib.Path(file.relative_to(root).parts[0]).stem
        for folder, header in re.findall(r'#include "alidade/(\w+)/([^"]+)"', file.read_text()):
            if folder != room:
                surface.setdefault(folder, set()).add(header)
    return surface


def crowded(files, root):
    """Folders with more headers than one screen of `ls` shows, but for those whose reason stands above."""
    folders = collections.Counter(str(file.relative_to(root).parent) for file in files if file.suffix == ".h")
    return [f"{folder}/: {count} headers, at most {HEADERS_A_FOLDER}" for folder, count in sorted(folders.items())
            if count > HEADERS_A_FOLDER and folder not in MORE_HEADERS_BECAUSE]


def main(root):
    faults, files = [], sorted(p for p in root.rglob("*") if p.suffix in {".h", ".cpp"})
    for file in files:
        faults += faults_of(file, file.relative_to(root).parts[0])
    faults += crowded(files, root)
    surface = surface_of(files, root)
    for folder, headers in sorted(surface.items()):
        if folder not in {"testing", "results", "tables", "simulate"} and len(headers) > PUBLIC_HEADERS_A_FOLDER:  # tests may share as they like; results/ has one outcome per job, tables/ one reader per kind, simulate/ one world per estimator
            faults.append(f"{folder}/: other folders include {len(headers)} of its headers, at most {PUBLIC_HEADERS_A_FOLDER} may be")
    if root.resolve().parts[-2:] == ("src", "alidade"):
        faults += outside_faults(root.resolve().parents[1])
    print("\n".join(faults) or f"layers ok ({len(files)} files)")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))

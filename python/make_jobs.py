#!/usr/bin/env python3
"""Writes jobs.py, plan.py, simulate.py and study.py of the package: make_jobs.py PACKAGE. A function for each command, whose
keywords, defaults and docs are the library's own descriptions of its fields and options."""
import keyword
import pathlib
import re
import sys
import textwrap

package = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(package))
import _alidade  # noqa: E402

JOBS = ["observe", "track", "rangefinder", "rig", "localize", "servo", "identify", "corners", "project", "reproduce"]
# Of a command line, not of a program: where results go, what is printed, and who watches.
NOT_HERE = {"help", "out", "json", "quiet", "no_report", "config", "csv", "live", "live_address", "live_pace", "version"}
# Of a campaign on several machines, or one that is gone on with: those write a folder, which the command does.
OF_CAMPAIGNS = {"shard", "resume", "block", "merge"}
BOARD = "The board"
# What a program gives in another way than the command line: by `board`, as values, as photos.
OF_CALIBRATE = {"photos", "corners", "size", "air", "skip_bad", "threads",
                "from", "no_page", "wait_s", "resume", "until_px"}  # of a capture, which is no job of a program
CALIBRATE = [
    ("photos", "Photos", "None", "Photos of the board: paths, patterns, folders, or arrays (H, W) or (H, W, 3), uint8 or uint16"),
    ("*", "", "", ""),
    ("board", "Board | None", "None", "The board: al.Board(\"9x6\", square_m=0.025)"),
    ("corners", "Any", "None", "Corners instead of photos: (N, P, 2) [px], NaN: not seen; or a CSV file, or its columns: "
                               "photo, corner, u_px, v_px[, sigma_u_px, sigma_v_px, corr_uv]"),
    ("sigma_px", "Any", "None", "σ of the corners [px]: one number, (N, P), or covariances (N, P, 2, 2) [px²]"),
    ("size", "tuple[int, int] | None", "None", "(width, height) [px] of the images that the corners are of"),
    ("air", "Any", "None", "flat_port: the lens from a calibration in air, a Camera or its file, fixed"),
    ("board_points", "Any", "None", "(P, 3) [m]: the board's points as an earlier run found them, fixed"),
    ("skip_bad", "bool", "False", "Reject rows of a table of corners that are wrong, by name"),
]
HEAD = '''"""{title} Made by make_jobs.py from the library's descriptions: do not edit."""
from __future__ import annotations

from typing import Any

from .board import Board
from .job import Input, Options, Photos, Progress, run_calibrate, run_command
from .result import Result

'''


def literal(option):
    """The default, as Python writes it."""
    text = option["standard"]
    if not option["form"]:
        return "False"
    if text == "" or option["is_list"]:
        return "None"
    for kind in (int, float):
        try:
            return repr(kind(text))
        except ValueError:
            pass
    return repr(text)


def annotation(option):
    standard, form = literal(option), option["form"]
    if not form:
        return "bool"
    kind = "Any"
    if re.fullmatch(r"[a-z0-9_-]+(\|[a-z0-9_-]+)+", form) and not option["is_list"]:
        kind = "str"
    elif form.startswith("NUMBER") and not option["is_list"] and " x " not in form:
        kind = "float"
    elif re.match(r"N\b", form) and not option["is_list"]:
        kind = "int"
    return kind if kind == "Any" or standard != "None" else kind + " | None"


def name_of(option):
    name = option["name"]
    return name + "_" if keyword.iskeyword(name) else name


def document(summary, entries):
    """The docstring: a line a keyword."""
    text = [f'    """{summary}.', ""]
    for name, help_text in entries:
        text += textwrap.wrap(f"{name}: {help_text}".replace("\\", "\\\\"), 118, initial_indent="    ",
                              subsequent_indent="        ")
    return text + ['    """']


def aliases_of(options):
    """Options as identifiers, where they are not the keyword itself."""
    found = {}
    for option in options:
        other = option["option"].removeprefix("--").replace("-", "_")
        if other and other != name_of(option):
            found[other] = name_of(option)
    return found


def signature(function, arguments):
    lines, line = [], f"def {function}("
    indent = " " * len(line)
    for i, argument in enumerate(arguments):
        piece = argument + (", " if i + 1 < len(arguments) else ") -> Result:")
        if len(line) + len(piece.rstrip()) > 120:
            lines.append(line.rstrip())
            line = indent
        line += piece
    return lines + [line]


def calibrate(command):
    described = [each for each in command["options"] if each["name"] not in OF_CALIBRATE | NOT_HERE and each["group"] != BOARD]
    arguments = [name if name == "*" else f"{name}: {kind} = {standard}" for name, kind, standard, _ in CALIBRATE]
    arguments[0] = "photos: Photos | None = None"
    arguments += [f"{name_of(each)}: {'Any' if each['name'] in ('fixed', 'free', 'prior') else annotation(each)} = {literal(each)}"
                  for each in described]
    arguments += ["progress: Progress | None = None", "**options: Any"]
    entries = [(name, text) for name, _, _, text in CALIBRATE if name != "*"]
    entries += [(name_of(each), each["help"].replace("--prior", "prior")) for each in described]
    entries.append(("progress", "Called as (what, done, total); where it returns False the job stops"))
    return [*signature("calibrate", arguments), *document(command["summary"], entries),
            f"    return run_calibrate(calibrate, locals(), {aliases_of(described)!r})", "", ""]


def job(command, function):
    options = [each for each in command["options"] if each["name"] not in NOT_HERE | OF_CAMPAIGNS]
    of_board = [each for each in options if each["group"] == BOARD]
    options = [each for each in options if each["group"] != BOARD]
    arguments = [f"{name_of(each)}: Input = None" for each in options if not each["option"]]
    keywords = [f"{name_of(each)}: {annotation(each)} = {literal(each)}" for each in options if each["option"]]
    entries = [(name_of(each), each["help"]) for each in options]
    if of_board:
        keywords.insert(0, "board: Board | None = None")
        entries.append(("board", "The board: al.Board(\"9x6\", square_m=0.025)"))
    entries.append(("progress", "Called as (what, done, total); where it returns False the job stops"))
    keywords += ["progress: Progress | None = None", "**options: Any"]
    table = {name_of(each): (each["option"], not each["form"], each["is_list"], each["form"]) for each in options}
    constant = f"_{function.upper()}"
    itself = f"globals()[{function!r}]" if function in {name_of(each) for each in options} | {"board"} else function
    body = [f"{constant}: Options = {{"]
    body += [f"    {name!r}: {entry!r}," for name, entry in table.items()]
    return [*body, "}", "", "", *signature(function, [*arguments, "*", *keywords]), *document(command["summary"], entries),
            f"    return run_command({command['name']!r}, {itself}, locals(), {constant}, {aliases_of(options)!r})", "", ""]


def write(file, title, functions):
    lines = HEAD.format(title=title).splitlines()
    for each in functions:
        lines += each
    while not lines[-1]:
        lines.pop()
    text = "\n".join(lines) + "\n"
    path = package / file
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


commands = {each["name"]: each for each in _alidade.commands()}
for each in commands["rig"]["options"]:  # the one command that takes several; `camera` is its other name
    if each["name"] == "camera":
        each["name"] = "cameras"
write("jobs.py", "The jobs, a function each.", [calibrate(commands["calibrate"]), *(job(commands[name], name) for name in JOBS)])
for group, title in (("plan", "What to do next, before it is done."), ("simulate", "Data with known truth."),
                     ("study", "Campaigns of simulated trials: is σ what it says?")):
    members = {name.split()[1]: each for name, each in commands.items() if name.startswith(group + " ")}
    members = {name: each for name, each in members.items() if name not in OF_CAMPAIGNS}
    write(group + ".py", title, [job(each, name.replace("-", "_")) for name, each in members.items()])

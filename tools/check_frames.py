#!/usr/bin/env python3
"""Fails where frame names do not cancel. In a product the inner names must be one frame,

    cam_from_world * world_from_board      cam_from_board * point_in_board      world_from_cam.inverse() * point_in_world

and what a product is assigned to must have its outer names: cam_from_board = cam_from_world * world_from_board. A column
or key of a document has the frame of the value that it is written from: add("target_in_world_", target_in_world).
"""
import pathlib
import re
import sys

WORD = r"[a-z][a-z0-9]*"  # a frame is one word, so that names can be read by a script
TAIL = r"(?:\[[^\[\]]*\]|\([^()]*\)|\.(?:rotation|translation|linear|value|at|conjugate|inverse)\b(?:\([^()]*\))?|->)*"
OWNER = r"(?:\w+(?:\[[^\[\]]*\]|\([^()]*\))?(?:\.|->))*"  # of a member: view. or views[i].
TRANSFORM = re.compile(rf"\b{OWNER}(?:\w+_)?(?P<to>{WORD})_from_(?P<frm>{WORD})\b(?P<tail>{TAIL})")
POINT = re.compile(rf"\b{OWNER}[a-z]\w*_in_(?P<at>{WORD})\b(?:{TAIL})")
ASSIGNED = re.compile(rf"(?:(?:\b|_)(?P<to>{WORD})_from_(?P<frm>{WORD})|\b[a-z]\w*_in_(?P<at>{WORD}))\s*(?:=|\{{|\()\s*$")
TIMES = re.compile(r"\s*\*\s*")
COLUMN = re.compile(rf'"[^"]*?_in_(?P<at>{WORD})(?:_[^"]*)?"')
FRAMES = {"world", "map", "board", "base", "pan", "tilt", "head", "cam", "body"}  # of what documents tell
END = re.compile(r"\s*(?:;|\}\s*;|$)")


def ends_of(transform):
    """(to, from) of a factor, turned round where it is inverted."""
    ends = transform["to"], transform["frm"]
    return ends[::-1] if re.search(r"\.(inverse|conjugate)\(", transform["tail"]) else ends


def chains_of(code):
    """Every product that begins with a transform: its place, its factors as (to, from) or (at,), and its end."""
    at = 0
    while first := TRANSFORM.search(code, at):
        factors, end = [ends_of(first)], first.end()
        while times := TIMES.match(code, end):
            if factor := TRANSFORM.match(code, times.end()):
                factors.append(ends_of(factor))
            elif factor := POINT.match(code, times.end()):
                factors.append((factor["at"],))
            else:
                break
            end = factor.end()
            if len(factors[-1]) == 1:
                break
        if len(factors) > 1:
            yield first.start(), factors, end
        at = end


def faults_of(code):
    """What is wrong with one line of code."""
    for start, factors, end in chains_of(code):
        for left, right in zip(factors, factors[1:]):
            if left[1] != right[0]:
                what = f"{right[0]}_from_{right[1]}" if len(right) == 2 else f"a point in {right[0]}"
                yield f"frames do not cancel: {left[0]}_from_{left[1]} * {what}"
        assigned = ASSIGNED.search(code[:start])
        if not assigned or not END.match(code, end):
            continue
        result = (factors[0][0], *factors[-1][1:])
        target = (assigned["at"],) if assigned["at"] else (assigned["to"], assigned["frm"])
        if target != result:
            yield f"{'_from_'.join(target)} is assigned {'_from_'.join(result)}"


def column_faults_of(code):
    """Names of columns in one line that say another frame than the values beside them."""
    values = {point["at"] for point in POINT.finditer(re.sub(r'"[^"]*"', '""', code))} & FRAMES
    for column in COLUMN.finditer(code):
        if column["at"] in FRAMES and values and column["at"] not in values:
            yield f"column {column[0]} holds a point in {' or '.join(sorted(values))}"


def main(folders):
    files = sorted(p for folder in folders for p in pathlib.Path(folder).rglob("*") if p.suffix in {".h", ".cpp"})
    faults, products = [], 0
    for file in files:
        for number, line in enumerate(file.read_text().splitlines(), 1):
            code = line.split("//")[0]
            products += sum(1 for _ in chains_of(code))
            faults += [f"{file}:{number}: {fault}" for fault in [*faults_of(code), *column_faults_of(code)]]
    print("\n".join(faults) or f"frames ok ({products} products in {len(files)} files)")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

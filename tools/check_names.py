#!/usr/bin/env python3
"""Fails if a type of the library is defined twice under one name: two headers that both define it cannot be included
together, and a reader of one believes that it is the other."""
import collections
import pathlib
import re
import sys

TYPE = re.compile(r"^(?:struct|class|enum class) (?:\[\[\w+\]\] )?([A-Z]\w+)(?: final)?\s*(?::[^:].*)?\{", re.MULTILINE)


def main(root):
    places = collections.defaultdict(set)
    for header in sorted(root.rglob("*.h")):
        if "testing" not in header.parts:
            for name in TYPE.findall(header.read_text()):
                places[name].add(str(header))
    faults = [f"{name} is defined in {' and '.join(sorted(files))}" for name, files in sorted(places.items())
              if len(files) > 1]
    print("\n".join(faults) or f"names ok ({len(places)} types)")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))

#!/usr/bin/env python3
"""docs/reference.md: every command with its options, and every name that it leaves, made of what the executable says of
itself (--help, schema).

    tools/reference.py ALIDADE > docs/reference.md
    tools/reference.py ALIDADE --check docs/reference.md    fails where it is stale"""
import json
import pathlib
import subprocess
import sys

from help_pages import pages

HEAD = """# Reference

Every command, its options, and the names in what it leaves. Made by `tools/reference.py` of what `alidade COMMAND --help` and
`alidade schema COMMAND` say; a test fails where this page is stale. What all results have in common: [What a run leaves](results.md).
"""


def type_of(schema):
    unit = schema.get("x-unit")
    types = [t for t in [schema.get("type", "any")] if t != "object"]
    kind = types[0][0] if types and isinstance(types[0], list) else (types or [""])[0]
    return unit or {"integer": "count", "string": "text", "boolean": "yes or no", "number": "1"}.get(kind, kind)


def names_in(schema, path=""):
    """(path, unit or kind, meaning) of every leaf."""
    if schema.get("type") == "array":
        length = schema.get("minItems", "")
        yield from names_in(schema["items"], f"{path}[{length}]")
        return
    members = dict(schema.get("properties", {}))
    if isinstance(schema.get("additionalProperties"), dict):
        members["*"] = schema["additionalProperties"]
    if not members:
        yield path, type_of(schema), schema.get("description", "")
    for name, member in members.items():
        yield from names_in(member, f"{path}.{name}" if path else name)


def table(head, rows):
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    lines += [f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in row)} |" for row in rows]
    return "\n".join(lines)


def names_text(schema):
    parts = schema["properties"]
    text = []
    estimate = [row for row in names_in(parts["estimate"]) if row[0]]
    if estimate:
        text += ["`estimate`, and under `stddev` their σ:", table(("name", "unit", "meaning"),
                                                                [(f"`{n}`", k, m) for n, k, m in estimate])]
    for part, words in (("data", "`data`, tables"), ("grids", "`grids`, values over the image")):
        rows = [(f"`{n.removesuffix('[]')}`", k, m) for n, k, m in names_in(parts[part])
                if n and ".thinned." not in n and n.split(".")[-1] not in ("cols", "rows", "u0_px", "v0_px", "du_px", "dv_px")]
        if rows:
            text += [words + ":", table(("name", "unit", "meaning"), rows)]
    for file, about in schema["x-files"].items():
        if "columns" in about:
            text += [f"`{file}`:", table(("column", "unit", "meaning"), [
                (f"`{name}`", column["kind"], column["description"]) for name, column in about["columns"].items()])]
        else:
            text.append(f"`{file}`: {about.get('description', '')}")
    return "\n\n".join(text)


def reference(alidade):
    text = [HEAD]
    for words, help_text in pages(alidade):
        if not words:
            continue
        text.append(f"## alidade {' '.join(words)}\n\n```\n{help_text.strip()}\n```")
        made = subprocess.run([alidade, "schema", *words], capture_output=True, text=True)
        if made.returncode == 0:
            text.append(names_text(json.loads(made.stdout)))
    return "\n\n".join(part for part in text if part) + "\n"


def main(alidade, *options):
    text = reference(alidade)
    if not options:
        sys.stdout.write(text)
        return 0
    page = pathlib.Path(options[1])
    if page.read_text() == text:
        print(f"reference ok ({len(text.splitlines())} lines)")
        return 0
    print(f"{page} is stale: tools/reference.py build/release/alidade > {page}")
    return 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

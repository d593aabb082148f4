#!/usr/bin/env python3
"""Every result document that a test made is as `alidade schema COMMAND` says.

    tools/schema_test.py ALIDADE FOLDER    of documents that tests of commands kept; exit code 77: there are none"""
import json
import pathlib
import subprocess
import sys

import jsonschema


def items(validator, of_each, instance, schema):
    """As Draft 2020-12, but of long columns, of which a schema says no more than types, one value of each type."""
    if not isinstance(instance, list) or set(of_each if isinstance(of_each, dict) else ()) - {"type", "description"} or schema.get("prefixItems"):
        yield from WHOLE.VALIDATORS["items"](validator, of_each, instance, schema)
        return
    kinds = {(type(value), isinstance(value, float) and value.is_integer()): i for i, value in enumerate(instance)}
    for i in sorted(kinds.values()):
        yield from validator.descend(instance[i], of_each, path=i)


WHOLE = jsonschema.Draft202012Validator
BRIEF = jsonschema.validators.extend(WHOLE, {"items": items})


def schema_of(alidade, command, known={}):
    if command not in known:
        text = subprocess.run([alidade, "schema", *command.split()], check=True, capture_output=True, text=True).stdout
        schema = json.loads(text)
        WHOLE.check_schema(schema)
        known[command] = BRIEF(schema)
    return known[command]


def main(alidade, folder):
    faults, num = {}, 0
    for file in sorted(pathlib.Path(folder).glob("*.json")):
        try:
            document = json.loads(file.read_text())
        except ValueError:
            continue  # a test's own broken file
        if not isinstance(document, dict) or document.get("schema") != "alidade-result/1" or "version" not in document:
            continue
        num += 1
        for error in schema_of(alidade, document["command"]).iter_errors(document):
            where = ".".join("*" if isinstance(part, int) else part for part in error.absolute_path)
            faults.setdefault(f"{document['command']}: {where}: {error.message[:160]}", file.name)
    print("\n".join(f"{fault} ({file})" for fault, file in faults.items()) or f"schema ok ({num} documents)")
    return bool(faults) or (77 if num == 0 else 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))

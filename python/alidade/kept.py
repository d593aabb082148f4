"""Results that an earlier run left, as files."""
from __future__ import annotations

import json
import pathlib
from typing import Any, Callable

import numpy as np

from . import _alidade
from .arrays import Numbers
from .camera import Camera

SCHEMA = "alidade-result/1"
STATES = ("good", "care", "bad", "refused", "not_converged")
#: What stands in a result.json, and of what kind it is.
KINDS = {"command": str, "verdict": dict, "counts": dict, "assumed": list, "estimate": dict, "stddev": dict, "stddev_model": dict,
         "covariance": dict, "files": list, "data": dict, "grids": dict}


class Kept:
    """Files as an earlier run left them, in the shape of _alidade.Outcome."""

    def __init__(self, files: dict[str, bytes], lines: list[str], camera: Camera | None = None,
                 model_covariance: Numbers | None = None) -> None:
        self.all_files, self.lines = files, lines
        self.camera = None if camera is None else camera._core
        self.model_covariance = np.zeros((0, 0)) if model_covariance is None else model_covariance
        self.document = document_of(files["result.json"])
        self.tables = list(self.document["data"])
        self.grids = list(self.document["grids"])
        self.files = [name for name in files if name not in ("result.json", "report.html")]

    def header(self) -> str:
        return json.dumps({key: value for key, value in self.document.items() if key not in ("data", "grids")})

    def table(self, name: str) -> list[tuple[str, Any]]:
        return list(self.document["data"][name].items())

    def grid(self, name: str) -> dict[str, Any]:
        grid = self.document["grids"][name]
        shape = grid["rows"], grid["cols"]
        return {key: np.array(value, dtype=float).reshape(shape) if isinstance(value, list) else value
                for key, value in grid.items() if key not in ("rows", "cols")}

    def file(self, name: str) -> bytes:
        return self.all_files[name]

    def save(self, folder: bytes) -> None:
        _alidade.save_files(list(self.all_files.items()), self.document["verdict"]["exit_code"], folder)


def document_of(text: bytes) -> dict[str, Any]:
    """Of result.json; ValueError with the first thing that is wrong with it."""
    try:
        document = json.loads(text)
    except ValueError as error:
        raise ValueError(f"result.json: is no JSON: {error}") from None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"result.json: is not of schema {SCHEMA}")
    for name, kind in KINDS.items():
        if not isinstance(document.get(name), kind):
            raise ValueError(f"result.json: {name} is {'not what it should be' if name in document else 'missing'}")
    checks: tuple[tuple[str, Callable[[Any], bool]], ...] = (("verdict", _is_verdict), ("covariance", _is_covariance), ("data", _are_tables),
                                                             ("grids", _are_grids), ("files", _are_names))
    for name, is_right in checks:
        if not is_right(document[name]):
            raise ValueError(f"result.json: {name} is not what it should be")
    return document


def _is_verdict(verdict: dict[str, Any]) -> bool:
    checks = verdict.get("checks")
    return (verdict.get("state") in STATES and isinstance(verdict.get("sentence"), str) and isinstance(verdict.get("to_add", 0), (str, type(None)))
            and isinstance(verdict.get("exit_code"), int) and 0 <= verdict["exit_code"] < 256
            and isinstance(checks, list) and all(isinstance(each, dict) for each in checks))


def _is_covariance(covariance: dict[str, Any]) -> bool:
    names, upper = covariance.get("names"), covariance.get("upper")
    return (isinstance(names, list) and _are_names(names) and isinstance(upper, list) and _are_numbers(upper)
            and len(upper) == len(names) * (len(names) + 1) // 2)


def _are_tables(tables: dict[str, Any]) -> bool:
    return all(isinstance(table, dict) and len({len(column) for column in table.values() if isinstance(column, list)}) < 2
               for table in tables.values())


def _are_grids(grids: dict[str, Any]) -> bool:
    return all(isinstance(grid, dict) and isinstance(grid.get("rows"), int) and isinstance(grid.get("cols"), int)
               and all(len(values) == grid["rows"] * grid["cols"] and _are_numbers(values) for values in grid.values() if isinstance(values, list))
               for grid in grids.values())


def _are_names(names: list[Any]) -> bool:
    return all(isinstance(each, str) for each in names)


def _are_numbers(values: list[Any]) -> bool:
    return all(each is None or isinstance(each, (int, float)) for each in values)


def files_beside(result: pathlib.Path) -> dict[str, bytes]:
    """A result's files by name: result.json first, then those it names, then the page."""
    if not result.is_file():
        raise ValueError("there is no such file")
    files = {"result.json": result.read_bytes()}
    for name in [*document_of(files["result.json"])["files"], "report.html"]:
        if (result.parent / name).is_file():
            files[name] = (result.parent / name).read_bytes()
    return files

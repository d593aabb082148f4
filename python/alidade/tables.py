"""Tables of a result as structured arrays, and columns as CSV."""
from __future__ import annotations

import csv
import io
from collections import abc
from typing import Any

import numpy as np

from .arrays import unmasked

TUM = ["t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]


def column(values: Any) -> np.ndarray[Any, Any]:
    """A column of a document: numbers with NaN for null, booleans, or words with "" for null."""
    if isinstance(values, np.ndarray):
        return values
    known = [each for each in values if each is not None]
    if known and all(isinstance(each, bool) for each in known) and len(known) == len(values):
        return np.array(values, dtype=bool)
    if all(isinstance(each, (int, float)) and not isinstance(each, bool) for each in known):
        whole = len(known) == len(values) and all(isinstance(each, int) for each in known) and known
        return np.array(values, dtype=np.int64 if whole else np.float64)
    if all(isinstance(each, str) for each in known):
        return np.array([each or "" for each in values], dtype=np.str_)
    boxed = np.empty(len(values), dtype=object)
    boxed[:] = values
    return boxed


def structured(columns: abc.Iterable[tuple[str, Any]]) -> np.ndarray[Any, Any]:
    """A structured array of columns of one length; those that are no column are omitted."""
    arrays = [(name, column(values)) for name, values in columns if isinstance(values, (list, np.ndarray))]
    length = len(arrays[0][1]) if arrays else 0
    table = np.empty(length, dtype=[(name, values.dtype) for name, values in arrays])
    for name, values in arrays:
        table[name] = values
    return table


def _numbers(texts: list[str]) -> Any:
    """Cells of a CSV file: whole numbers, numbers (an empty one is NaN), or words."""
    try:
        return [int(text) for text in texts]
    except ValueError:
        pass
    try:
        return [float(text) if text else np.nan for text in texts]
    except ValueError:
        return texts


def of_csv(text: str) -> np.ndarray[Any, Any]:
    """A table of CSV text with a header."""
    rows = [row for row in csv.reader(io.StringIO(text)) if row]
    if not rows:
        return np.empty(0, dtype=[])
    cells = list(zip(*rows[1:])) if len(rows) > 1 else [()] * len(rows[0])
    return structured((name, _numbers(list(each)) or np.empty(0)) for name, each in zip(rows[0], cells))


def of_tum(text: str) -> np.ndarray[Any, Any]:
    """A path: t x y z qx qy qz qw."""
    rows = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
    cells = list(zip(*rows)) if rows else [()] * len(TUM)
    return structured((name, np.array(each, dtype=float)) for name, each in zip(TUM, cells))


def is_table(value: Any) -> bool:
    """A mapping of columns, a structured array, or a DataFrame."""
    if isinstance(value, np.ndarray):
        return value.dtype.names is not None
    return isinstance(value, abc.Mapping) or (hasattr(value, "columns") and hasattr(value, "iloc"))


def _times(array: np.ndarray[Any, Any], are_ns: bool) -> list[str]:
    """Dates or durations of any unit as seconds, or nanoseconds, to the last digit; NaT is an empty cell."""
    ns = array.astype(f"{array.dtype.kind}8[ns]")
    whole = [None if missing else int(each) for each, missing in zip(ns.astype(np.int64), np.isnat(ns))]
    if are_ns:
        return ["" if each is None else str(each) for each in whole]
    return ["" if each is None else f"{'-' if each < 0 else ''}{abs(each) // 10**9}.{abs(each) % 10**9:09d}" for each in whole]


def _cells(values: Any, name: str) -> list[str]:
    array = unmasked(np.asanyarray(values))
    if array.ndim != 1:
        raise ValueError(f"column '{name}': one number per row is needed, but the shape is {array.shape}")
    if array.dtype.kind in "mM":
        return _times(array, name.endswith("_ns"))
    if array.dtype.kind == "f":
        return ["" if each != each else repr(each) for each in array.tolist()]
    return ["" if each is None or str(each) in ("nan", "<NA>", "NaT") else str(each) for each in array.tolist()]


def csv_of(table: Any, what: str) -> str:
    """Columns by the names of the CSV file, as its text; NaN is an empty cell."""
    names = list(table.dtype.names if isinstance(table, np.ndarray) else table.keys())
    columns = [_cells(table[name], str(name)) for name in names]
    if not columns:
        raise ValueError(f"{what}: there are no columns")
    lengths = {len(each) for each in columns}
    if len(lengths) > 1:
        raise ValueError(f"{what}: columns differ in length: "
                         + ", ".join(f"{name} {len(each)}" for name, each in zip(names, columns)))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns))
    return text.getvalue()

"""What a job leaves: verdict, estimate with its covariance, tables, files."""
from __future__ import annotations

import html
import json
import math
import os
import pathlib
import tempfile
import types
from collections import abc
from typing import TYPE_CHECKING, Any, Callable

import numpy as np

from . import _alidade
from .arrays import Numbers, folder_name, name_shown
from .camera import Camera
from .errors import CannotDetermine, NoConvergence, NotTrusted
from .kept import Kept, files_beside
from .tables import of_csv, of_tum, structured
from .words import suggestion

if TYPE_CHECKING:
    from . import plots as _plots

SYMBOLS = {"good": "●", "care": "◆", "bad": "▲", "refused": "■", "not_converged": "✕"}


class Check(types.SimpleNamespace):
    """One thing that was checked: name, state, text, value, limit, unit, figure."""

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)


class Verdict:
    """How the answer stands: `state` "good", "care", "bad", "refused" or "not_converged"; true for the first two.

    sentence   what to think of it
    to_add     what to do next; "" for nothing
    checks     list of Check: name, state, text, value, limit, unit
    exit_code  of the command
    """

    __slots__ = ("state", "sentence", "to_add", "exit_code", "checks")
    state: str
    sentence: str
    to_add: str
    exit_code: int
    checks: list[Check]

    def __init__(self, document: dict[str, Any]) -> None:
        self.state = document["state"]
        self.sentence = document["sentence"]
        self.to_add = document["to_add"] or ""
        self.exit_code = document["exit_code"]
        self.checks = [Check(**{key: math.nan if value is None and key in ("value", "limit") else value
                                for key, value in each.items()}) for each in document["checks"]]

    def __bool__(self) -> bool:
        return self.state in ("good", "care")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Verdict):
            return NotImplemented
        return bool(repr(self) == repr(other))

    def __repr__(self) -> str:
        after = f"\n  next: {self.to_add}" if self.to_add else ""
        return f"{SYMBOLS[self.state]} {self.sentence}{after}"


def _text(table: bytes) -> str:
    """Of a table, in which names of files may stand that are no UTF-8."""
    return table.decode(errors="surrogateescape")


class Tables(abc.Mapping[str, "np.ndarray[Any, Any]"]):
    """Tables by name, structured arrays: `pandas.DataFrame(r.tables["corners"])`. Those of the document, and the CSV (and
    TUM) files beside it."""

    def __init__(self, source: Any) -> None:
        self._source = source
        self._made: dict[str, np.ndarray[Any, Any]] = {}
        self._files = {}
        for file in source.files:
            stem, ending = os.path.splitext(file)
            if ending in (".csv", ".tum") and stem not in source.tables:
                self._files[stem] = file
        for name in source.tables:  # of which the document has a part
            if name + "_all" in self._files:
                self._files[name] = self._files.pop(name + "_all")

    def __getitem__(self, name: str) -> np.ndarray[Any, Any]:
        if name not in self._made:
            if name in self._files:
                text = _text(self._source.file(self._files[name]))
                self._made[name] = of_tum(text) if self._files[name].endswith(".tum") else of_csv(text)
            elif name in self._source.tables:
                self._made[name] = self._in_full(name, structured(self._source.table(name)))
            else:
                raise KeyError(f"{name}; there are {', '.join(self)}")
        return self._made[name]

    def _in_full(self, name: str, table: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """The document's table, whose numbers are rounded for the page, with those of the file of its name."""
        if name + ".csv" not in self._source.files:
            return table
        exact = of_csv(_text(self._source.file(name + ".csv")))
        rounded_by = 0.006
        shared = [column for column in exact.dtype.names or () if column in table.dtype.names and exact[column].dtype.kind == "f"]
        if len(exact) != len(table) or any(np.nanmax(abs(exact[each] - table[each]), initial=0.0) > rounded_by for each in shared):
            return table  # of other rows
        more = [column for column in exact.dtype.names if column not in table.dtype.names]
        columns = [(column, table[column]) for column in table.dtype.names] + [(column, exact[column]) for column in more]
        full = structured(columns)
        for column in shared:
            full[column] = exact[column]
        return full

    def __iter__(self) -> abc.Iterator[str]:
        return iter([*self._source.tables, *(name for name in self._files if name not in self._source.tables)])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __reduce__(self) -> tuple[Callable[..., Tables], tuple[dict[str, np.ndarray[Any, Any]]]]:
        return _held_tables, (dict(self),)

    def __repr__(self) -> str:
        return f"Tables({', '.join(self)})"


def _held_tables(tables: dict[str, np.ndarray[Any, Any]]) -> Tables:
    held = Tables(types.SimpleNamespace(tables=list(tables), files=[]))
    held._made = tables
    return held


class Grids(abc.Mapping[str, "dict[str, Any]"]):
    """Values over the image by name: u0_px, v0_px, du_px, dv_px, and arrays (rows, cols)."""

    def __init__(self, source: Any) -> None:
        self._source = source

    def __getitem__(self, name: str) -> dict[str, Any]:
        if name not in self._source.grids:
            raise KeyError(name)
        return self._source.grid(name)

    def __iter__(self) -> abc.Iterator[str]:
        return iter(self._source.grids)

    def __len__(self) -> int:
        return len(self._source.grids)

    def __reduce__(self) -> tuple[Callable[..., Grids], tuple[dict[str, dict[str, Any]]]]:
        return _held_grids, (dict(self),)


def _held_grids(grids: dict[str, dict[str, Any]]) -> Grids:
    return Grids(types.SimpleNamespace(grids=list(grids), grid=grids.__getitem__))


def _value(value: Any) -> Any:
    """Of the document: null is NaN, lists of numbers are arrays, objects have attributes."""
    if value is None:
        return math.nan
    if isinstance(value, dict):
        return types.SimpleNamespace(**{key: _value(each) for key, each in value.items()})
    if isinstance(value, list) and value and all(isinstance(each, (int, float)) for each in value):
        return np.array(value)
    return value


class Result:
    """What a job leaves. Its estimate stands in `estimate`, by the names of result.json, and as attributes: `r.rms_px`."""

    __slots__ = ("_source", "_document", "_tables", "__weakref__")

    def __init__(self, source: Any) -> None:
        self._source = source
        self._document: dict[str, Any] = json.loads(source.header())
        self._tables = Tables(source)

    @property
    def verdict(self) -> Verdict:
        """How the answer stands: state, sentence, to_add, checks."""
        return Verdict(self._document["verdict"])

    @property
    def command(self) -> str:
        """The job: "calibrate", …"""
        return self._document["command"]

    @property
    def estimate(self) -> dict[str, Any]:
        """The values, as in result.json."""
        return self._document["estimate"]

    @property
    def stddev(self) -> dict[str, Any]:
        """Their σ by the same names."""
        return self._document["stddev"]

    @property
    def counts(self) -> dict[str, Any]:
        """given, used, dropped, and skipped: what was rejected, and why."""
        return self._document["counts"]

    @property
    def assumed(self) -> list[dict[str, Any]]:
        """What was taken as given, and how far it would move the answer."""
        return self._document["assumed"]

    @property
    def parameter_names(self) -> list[str]:
        """The n parameters of `covariance`, in its order."""
        return self._document["covariance"]["names"]

    @property
    def covariance(self) -> Numbers:
        """(n, n) over `parameter_names`."""
        count = len(self.parameter_names)
        square = np.zeros((count, count))
        rows, cols = np.triu_indices(count)
        square[rows, cols] = np.array(self._document["covariance"]["upper"], dtype=np.float64)  # null: NaN
        square[cols, rows] = square[rows, cols]
        return square

    @property
    def stddev_model(self) -> dict[str, Any]:
        """The same σ if every single measurement erred by itself, as other tools state it."""
        return self._document["stddev_model"]

    @property
    def model_covariance(self) -> Numbers | None:
        """(P, P) over `camera.parameter_names` of a calibration, as if every corner erred by itself, as OpenCV and mrcal
        state it; None of other results and of those that were read."""
        covariance = self._source.model_covariance
        return covariance if covariance.size else None

    @property
    def camera(self) -> Camera | None:
        """The camera that was estimated, with its covariance; None where there is none."""
        if self._source.camera is not None:
            return Camera._of(self._source.camera)
        if "camera.yaml" not in self._source.files:
            return None
        return Camera._of(_alidade.parse_camera(self._source.file("camera.yaml").decode(), "camera.yaml"))

    @property
    def tables(self) -> Tables:
        """Structured arrays by name: the document's data, and the CSV files."""
        return self._tables

    @property
    def grids(self) -> Grids:
        """Values over the image by name."""
        return Grids(self._source)

    @property
    def files(self) -> list[str]:
        """Names of the files beside result.json."""
        return list(self._source.files)

    def file(self, name: str) -> bytes:
        """The bytes of one of `files`."""
        if name not in self._source.files:
            raise KeyError(f"{name}; there are {', '.join(self._source.files)}")
        return self._source.file(name)

    @property
    def plot(self) -> _plots.Plots:
        """Figures: matplotlib Axes in, Axes out."""
        from .plots import Plots
        return Plots(self)

    def require(self) -> Result:
        """Itself where the answer stands; raises CannotDetermine, NoConvergence or NotTrusted otherwise."""
        verdict = self.verdict
        if verdict:
            return self
        kinds = {"refused": CannotDetermine, "not_converged": NoConvergence}
        raise kinds.get(verdict.state, NotTrusted)("; ".join(filter(None, (verdict.sentence, verdict.to_add))))

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Leaves in the folder what the command leaves there: result.json, the files, report.html; all at once or none."""
        self._source.save(folder_name(folder))

    def report(self) -> Report:
        """The page of the result, to be seen in a notebook; str() is its HTML."""
        return Report(self._saved()["report.html"].decode())

    def document(self) -> dict[str, Any]:
        """result.json whole."""
        return json.loads(self._saved()["result.json"])

    def _saved(self) -> dict[str, bytes]:
        if isinstance(self._source, Kept):
            return self._source.all_files
        with tempfile.TemporaryDirectory(prefix="alidade-") as folder:
            self.save(folder)
            return files_beside(pathlib.Path(folder) / "result.json")

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_") and name in self.estimate:
            return _value(self.estimate[name])
        if name.startswith("_"):
            raise AttributeError(f"a result has no '{name}'")
        raise AttributeError(f"this result of {self.command} has no '{name}'{suggestion(name, dir(self))}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.estimate})

    def _comparable(self) -> dict[str, Any]:
        passing = ("argv", "created_utc", "seconds", "inputs", "files", "data", "grids")
        return {key: value for key, value in self._document.items() if key not in passing}

    def __eq__(self, other: object) -> bool:
        """The same but for time and the names of the inputs."""
        if not isinstance(other, Result):
            return NotImplemented
        return (self._comparable() == other._comparable() and self.files == other.files
                and all(self.file(name) == other.file(name) for name in self.files))

    def __hash__(self) -> int:
        return hash(json.dumps(self._comparable(), sort_keys=True))

    def __reduce__(self) -> tuple[Callable[..., Result], tuple[Any, ...]]:
        return _of_files, (self._saved(), self._source.lines, self.camera, self.model_covariance)

    def __copy__(self) -> Result:
        return self

    def __deepcopy__(self, memo: Any) -> Result:
        return self

    def __repr__(self) -> str:
        lines = self._source.lines or [f"{name} {value:.6g} {sigma}".rstrip()
                                       for name, value, sigma in _shown(self.estimate, self.stddev)]
        return "\n".join([*lines, repr(self.verdict)])

    def _repr_html_(self) -> str:
        rows = [f"<tr><th>{html.escape(name)}</th><td>{value:.6g}</td><td>{sigma}</td></tr>"
                for name, value, sigma in _shown(self.estimate, self.stddev)]
        text = html.escape(repr(self.verdict)).replace("\n", "<br>")
        return f"<p>{text}</p><table>{''.join(rows)}</table>"


def _shown(estimate: dict[str, Any], stddev: dict[str, Any], prefix: str = "") -> abc.Iterator[tuple[str, float, str]]:
    """Numbers of the estimate with ± 3σ, by name; of an object its members."""
    for name, value in estimate.items():
        sigma = stddev.get(name)
        if isinstance(value, dict):
            yield from _shown(value, sigma if isinstance(sigma, dict) else {}, f"{prefix}{name}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield prefix + name, value, f"± {3 * sigma:.2g}" if isinstance(sigma, (int, float)) else ""


class Report:
    """The page of a result: one HTML file that opens offline."""

    def __init__(self, page: str) -> None:
        self.page = page

    def __str__(self) -> str:
        return self.page

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.page)}" width="100%" height="800" frameborder="0"></iframe>'


def _of_files(files: dict[str, bytes], lines: list[str], camera: Camera | None = None,
              model_covariance: Numbers | None = None) -> Result:
    return Result(Kept(files, lines, camera, model_covariance))


def read_result(path: str | os.PathLike[str]) -> Result:
    """The result of an earlier run, the command's or Python's: its folder, or the result.json in it, by whatever name."""
    result = pathlib.Path(path)
    if result.is_dir():
        result = result / "result.json"
    try:
        files = files_beside(result)
        return _of_files(files, [])
    except OSError as error:
        raise ValueError(f"{name_shown(path)}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"{name_shown(path)}: is no result of alidade: {error}") from None

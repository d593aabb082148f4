"""Runs jobs: what a user gave, as paths or values, becomes what the library takes."""
from __future__ import annotations

import contextlib
import glob
import json
import os
import pathlib
import re
import tempfile
from collections import abc
from typing import Any, Callable, Union

import numpy as np

from . import _alidade
from .arrays import file_name, image, image_size, name_shown, numbers, plain
from .board import Board
from .camera import Camera
from .result import Result
from .tables import csv_of, is_table
from .words import suggestion, text_of, texts_of

#: Called now and then as (what, done, total); where it returns False the job stops, and Interrupted is raised.
Progress = Callable[[str, int, int], Any]
#: A file, or its content: columns by name, a Camera, a Result.
Input = Any
#: (option, takes no value, takes several values, form), by the keyword.
Options = dict[str, tuple[str, bool, bool, str]]
#: Columns of a table that may name files, beside it or where the program runs.
PHOTO_COLUMNS = ("photo", "photo_off")
#: The file of a result that a keyword takes, where it is not called like it.
FILE_OF = {"beam": "rangefinder", "cameras": "camera"}
#: What OpenCV's users and the command line give beside the board; here it is the board's own.
BOARD_FIELDS = ("square_m", "square", "square_size", "marker_m", "marker", "board_kind", "dictionary")
OF_THE_BOARD = ': it is the board\'s, as in board=al.Board("9x6", square_m=0.025)'
Photos = Union[str, "os.PathLike[str]", "abc.Sequence[Any]", "np.ndarray[Any, Any]"]


def given_of(function: Callable[..., Any], values: dict[str, Any], aliases: dict[str, str]) -> dict[str, Any]:
    """Keywords that are not the function's defaults, by the fields' names."""
    more = values.pop("options", {})
    standard = function.__kwdefaults__ or {}
    given = {name: value for name, value in values.items() if not _is_standard(value, standard.get(name))}
    for name, value in more.items():
        if name not in aliases:
            known = [*standard, *aliases]
            hint = OF_THE_BOARD if name in BOARD_FIELDS and "board" in standard else suggestion(name, known)
            raise TypeError(f"{function.__name__}() has no keyword '{name}'{hint}")
        if aliases[name] in given:
            raise TypeError(f"{function.__name__}(): '{name}' and '{aliases[name]}' are the same")
        given[aliases[name]] = value
    return given


def _is_standard(value: Any, standard: Any) -> bool:
    return value is standard or (isinstance(value, (str, int, float)) and type(value) is type(standard) and value == standard)


def _is_image(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind == "u" and (value.ndim == 2 or value.ndim == 3 and not _are_images(value))


def _are_images(value: Any) -> bool:
    """Several images (N, H, W[, 3]), or a list of them."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind == "u" and (value.ndim == 4 or value.ndim == 3 and value.shape[2] not in (1, 3, 4))
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(isinstance(each, np.ndarray) for each in value)


def _is_column(value: Any) -> bool:
    is_nested = isinstance(value, (list, tuple)) and any(isinstance(each, abc.Mapping) for each in value)
    return hasattr(value, "__len__") and not isinstance(value, (str, abc.Mapping)) and not is_nested


class _Files:
    """Values that the job reads as files, in a folder that goes with the call."""

    def __init__(self, folder: str) -> None:
        self.folder = pathlib.Path(folder)
        self.names: list[tuple[str, str]] = []  # file, what the user called it

    def _put(self, name: str, ending: str, text: str) -> str:
        file = self.folder / f"{name}{len(self.names)}{ending}"
        file.write_text(text, encoding="utf-8", errors="surrogateescape")  # it may name files
        self.names.append((str(file), name))
        return str(file)

    def _put_image(self, value: Any, name: str) -> str:
        file = self.folder / f"{name}{len(self.names):06d}.png"
        file.write_bytes(_alidade.png(image(value, name)))
        self.names.append((str(file), name))
        return str(file)

    def _put_images(self, values: Any, name: str) -> str:
        """A folder of numbered images, in their order."""
        folder = self.folder / f"{name}{len(self.names)}"
        folder.mkdir()
        self.names.append((str(folder), name))
        for i, each in enumerate(values):
            (folder / f"{i:06d}.png").write_bytes(_alidade.png(image(each, f"{name}[{i}]")))
        return str(folder)

    def _with_photos(self, table: Any) -> Any:
        """Photos that a table names are found from where the program runs, and may be images themselves."""
        names = table.dtype.names if isinstance(table, np.ndarray) else list(table.keys())
        if not any(name in names for name in PHOTO_COLUMNS):
            return table
        columns = {name: table[name] for name in names}
        for name in PHOTO_COLUMNS:
            if name in columns:
                columns[name] = [self._photo_cell(each, name) for each in columns[name]]
        return columns

    def _photo_cell(self, cell: Any, name: str) -> Any:
        if isinstance(cell, np.ndarray):
            return self._put_image(cell, name)
        if isinstance(cell, (str, os.PathLike)) and os.path.exists(cell):
            return os.path.abspath(cell)
        return cell

    def path_of(self, value: Any, name: str) -> str:
        """The file of a value: columns as CSV, nested values and a camera as YAML, images as a folder of PNGs, a result as its
        folder or the file of that name in it."""
        if isinstance(value, abc.Mapping) and not all(_is_column(each) for each in value.values()):
            try:
                return self._put(name, ".yaml", json.dumps(value, default=plain))  # which is YAML as well
            except TypeError as error:
                raise ValueError(f"{name}: {error}") from None
        if is_table(value):
            return self._put(name, ".csv", csv_of(self._with_photos(value), name))
        if _is_image(value):
            return self._put_image(value, name)
        if isinstance(value, Camera):
            return self._put(name, ".yaml", value.text())
        if not isinstance(value, Result):
            return text_of(value, name)
        folder = self.folder / f"{name}{len(self.names)}"
        value.save(folder)
        stem = FILE_OF.get(name, name)
        own = next((folder / file for file in value.files if os.path.splitext(file)[0] == stem), folder)
        self.names.append((str(own), name))
        return str(own)

    def texts_of(self, value: Any, name: str, form: str) -> list[str]:
        if isinstance(value, (Camera, Result)) or is_table(value) or _is_image(value):
            return [self.path_of(value, name)]
        if _are_images(value):
            return [self._put_images(value, name)]
        if re.fullmatch(r"[A-Z][A-Za-z]*x[A-Z][A-Za-z]*", form):
            return ["{}x{}".format(*image_size(value, name))] if name == "size" else texts_of(value, name, pair=True)
        if isinstance(value, np.ndarray) and value.ndim > 1:
            raise ValueError(f"{name}: a file, or columns by their names, are needed, not an array {value.shape}")
        if isinstance(value, (list, tuple)):
            return [self.path_of(each, name) for each in value]
        return texts_of(value, name)


@contextlib.contextmanager
def files_for_call() -> abc.Iterator[_Files]:
    with tempfile.TemporaryDirectory(prefix="alidade-", ignore_cleanup_errors=True) as folder:
        files = _Files(folder)
        try:
            yield files
        except ValueError as error:  # in the user's words
            said = str(error)
            for file, name in files.names:
                said = said.replace(file, name)
            said = said.replace(folder + os.sep, "")
            raise ValueError(said) from None


def run_command(command: str, function: Callable[..., Any], values: dict[str, Any], options: Options,
                aliases: dict[str, str]) -> Result:
    """A job by its command's words: for rooms whose values have no face of their own yet."""
    progress = values.pop("progress", None)
    given = given_of(function, values, aliases)
    board = given.pop("board", None)
    with files_for_call() as files:
        arguments: list[str] = []
        words: list[str] = []
        for name, value in given.items():
            option, is_flag, is_list, form = options[name]
            if value is None:
                continue
            if is_flag:
                words += [option] if value else []
                continue
            texts = files.texts_of(_globbed(value) if not option else value, name, form)
            for text in texts:
                file_name(text, name)  # by its keyword, where it holds a zero byte
            if not option:
                if any(text.startswith("-") for text in texts):
                    raise ValueError(f"{name}: {texts[0]!r} is no file")
                arguments += texts
            elif is_list:
                words += [option, *texts]
            elif form.startswith("FILE"):  # once for each
                words += [f"{option}={text}" for text in texts]
            else:
                words.append(f"{option}={','.join(texts)}")
        if board is not None:
            if not isinstance(board, Board):
                raise ValueError(f"board: an alidade.Board is needed, not {type(board).__name__}")
            words += [f"{option}={text}" for option, text in board._core.options.items()]
        outcome = _alidade.run_command([*command.split(), *map(os.fsencode, (*arguments, *words))], progress)
        outcome.rename_inputs(files.names)
    return Result(outcome)


def _globbed(value: Any) -> Any:
    """Paths of patterns, in their order; anything else as it is."""
    if isinstance(value, str) and glob.has_magic(value) and not os.path.exists(value):
        found = sorted(glob.glob(value, recursive=True))
        if not found:
            raise ValueError(f"{name_shown(value)}: no file is called so")
        return found
    return value


def _photo_paths(photos: Any) -> list[str] | None:
    """Paths, folders and patterns as paths; None where they are arrays."""
    items = [photos] if isinstance(photos, (str, os.PathLike)) else photos
    if not all(isinstance(each, (str, os.PathLike)) for each in items):
        return None
    paths: list[str] = []
    for each in items:
        found = _globbed(os.fspath(each))
        paths += found if isinstance(found, list) else [found]
    return paths


def run_calibrate(function: Callable[..., Any], values: dict[str, Any], aliases: dict[str, str]) -> Result:
    """From photos (paths or arrays) or from corners (arrays, a file, columns)."""
    progress = values.pop("progress")
    given = given_of(function, values, aliases)
    take = {name: given.pop(name, None)
            for name in ("photos", "corners", "board", "air", "board_points", "size", "sigma_px", "skip_bad")}
    board, air = take["board"], take["air"]
    if not isinstance(board, Board):
        raise ValueError("board: an alidade.Board is needed, for example al.Board(\"9x6\", square_m=0.025)")
    if (take["photos"] is None) == (take["corners"] is None):
        raise ValueError("give photos, or corners=" if take["photos"] is None else "corners replace photos")
    texts = [(name, texts_of(value, name)) for name, value in given.items() if value is not None]
    if air is not None and not isinstance(air, Camera):
        air = Camera.read(text_of(air, "air"))
    camera = None if air is None else air._core
    points = np.zeros((0, 3)) if take["board_points"] is None else _board_points(take["board_points"])
    rest = (board._core, texts, camera, points, progress)
    if take["photos"] is not None:
        if take["sigma_px"] is not None:
            raise ValueError("sigma_px is of corners: photos have their own")
        return _from_photos(take["photos"], take["size"], rest)
    return _from_corners(take, board, rest)


def _board_points(points: Any) -> Any:
    array = numbers(points, "board_points")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"board_points: (P, 3) is needed, but the shape is {array.shape}")
    return array


def _from_photos(photos: Any, size: Any, rest: tuple[Any, ...]) -> Result:
    if isinstance(photos, np.ndarray) and photos.ndim == 2:
        photos = [photos]
    if not isinstance(photos, (str, os.PathLike)):
        try:
            photos = list(photos)
        except TypeError:
            raise ValueError(f"photos: {type(photos).__name__} is neither paths nor images") from None
    paths = _photo_paths(photos)
    if paths is not None:
        if not paths:
            raise ValueError("photos: there are none")
        return Result(_alidade.calibrate_files([file_name(each, "photos") for each in paths], *rest))
    images = [image(each, f"photos[{i}]") for i, each in enumerate(photos)]
    if size is not None and images[0].shape[1::-1] != image_size(size):
        raise ValueError(f"the photos are {images[0].shape[1]}x{images[0].shape[0]}, not as size says")
    names = [f"photo {i}" for i in range(len(images))]
    return Result(_alidade.calibrate_images(names, images, *rest))


def _from_corners(take: dict[str, Any], board: Board, rest: tuple[Any, ...]) -> Result:
    corners, size = take["corners"], (0, 0) if take["size"] is None else image_size(take["size"])
    if isinstance(corners, (str, os.PathLike)) or is_table(corners):
        if take["sigma_px"] is not None:
            raise ValueError("sigma_px: a table of corners has columns sigma_u_px, sigma_v_px for it")
        with files_for_call() as files:
            file = file_name(files.path_of(corners, "corners"), "corners")
            return Result(_alidade.calibrate_corner_file(file, bool(take["skip_bad"]), size, *rest))
    pixels = numbers(corners, "corners")
    if pixels.ndim == 4 and pixels.shape[2] == 1:  # (N, P, 1, 2), as OpenCV has them
        pixels = pixels[:, :, 0, :]
    if pixels.ndim != 3 or pixels.shape[1:] != (board.num_points, 2):
        raise ValueError(f"corners: (N, {board.num_points}, 2) is needed, but the shape is {pixels.shape}")
    if pixels.shape[0] == 0:
        raise ValueError("corners: there are none")
    if np.isinf(pixels).any():
        raise ValueError("corners: infinity is no pixel; NaN: not seen")
    names = [f"view {i}" for i in range(len(pixels))]
    return Result(_alidade.calibrate_corners(names, np.ascontiguousarray(pixels), _covariances(take["sigma_px"], pixels),
                                             size, *rest))


def _covariances(sigma_px: Any, pixels: Any) -> Any:
    """(N, P, 2, 2) [px²] of σ: one number, (N, P), (N, P, 2), or covariances (N, P, 2, 2)."""
    if sigma_px is None:
        return np.zeros((0, 0, 2, 2))
    sigma, shape = numbers(sigma_px, "sigma_px"), pixels.shape[:2]
    seen = np.isfinite(pixels).all(axis=2)
    if sigma.shape == (*shape, 2, 2):
        skew = np.abs(sigma[..., 0, 1] - sigma[..., 1, 0]) > 1e-9 * np.abs(sigma[..., 0, 0] + sigma[..., 1, 1])
        if (skew & seen).any():
            photo, corner = np.argwhere(skew & seen)[0]
            raise ValueError(f"sigma_px: the covariance of photo {photo}, corner {corner} is not symmetric")
        return np.ascontiguousarray(sigma)
    if sigma.shape in ((), shape):
        sigma = np.broadcast_to(sigma, shape)[:, :, None].repeat(2, axis=2)
    if sigma.shape != (*shape, 2):
        raise ValueError(f"sigma_px: one number, {shape}, or covariances {(*shape, 2, 2)}, but the shape is {sigma.shape}")
    if not (np.isfinite(sigma[seen]).all() and (sigma[seen] > 0.0).all()):
        raise ValueError("sigma_px: a σ is not above 0")
    covariances = np.zeros((*shape, 2, 2))
    covariances[..., 0, 0], covariances[..., 1, 1] = sigma[..., 0] ** 2, sigma[..., 1] ** 2
    return covariances

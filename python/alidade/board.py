"""Calibration targets, and finding them in images."""
from __future__ import annotations

import os
from collections import abc
from typing import Any, Callable

import numpy as np

from . import _alidade
from .arrays import Numbers, file_name
from .arrays import image as pixels_of
from .former import former
from .words import texts_of


class Board:
    """A calibration target. Never changes.

    board       inner corners (circles, tags) along and across: "9x6" or (9, 6)
    square_m    side of a square, distance of circles, side of a tag [m], or "25mm"
    board_kind  "chessboard", "charuco", "aprilgrid", "circles", "asymmetric_circles"
    marker_m    side of a marker (charuco), gap between tags (aprilgrid), diameter (circles) [m]
    dictionary  of the markers of a charuco board, for example "DICT_5X5_100"
    """

    __slots__ = ("_core",)
    _core: _alidade.Board

    def __init__(self, board: str | tuple[int, int], square_m: float | str, board_kind: str = "chessboard",
                 marker_m: float | str | None = None, dictionary: str | None = None) -> None:
        given = {"board": board, "square_m": square_m, "board_kind": board_kind, "marker_m": marker_m,
                 "dictionary": dictionary}
        self._core = _alidade.Board([(name, texts_of(value, name, pair=name == "board")) for name, value in given.items()
                                     if value is not None])

    @property
    def cols(self) -> int:
        """Points (tags) along x."""
        return self._core.cols

    @property
    def rows(self) -> int:
        """Points (tags) along y."""
        return self._core.rows

    @property
    def square_m(self) -> float:
        """[m]"""
        return self._core.square_m

    @property
    def kind(self) -> str:
        """What is printed on it."""
        return self._core.kind

    @property
    def marker_m(self) -> float:
        """[m]; 0: none."""
        return self._core.marker_m

    @property
    def dictionary(self) -> str:
        """Of the markers; "" where there are none."""
        return self._core.dictionary

    @property
    def num_points(self) -> int:
        """P: corners, circles, or four a tag."""
        return self._core.num_points

    @property
    def points(self) -> Numbers:
        """(P, 3) [m] in the board's frame: x along the columns, y along the rows, z = 0, numbered row by row."""
        return self._core.points

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Board):
            return NotImplemented
        return bool(self._core.texts == other._core.texts)

    def __hash__(self) -> int:
        return hash(tuple(self._core.texts.items()))

    def __reduce__(self) -> tuple[Callable[..., Board], tuple[dict[str, str]]]:
        return _restored, (self._core.texts,)

    def __copy__(self) -> Board:
        return self

    def __deepcopy__(self, memo: Any) -> Board:
        return self

    def __repr__(self) -> str:
        rest = {name: text for name, text in self._core.texts.items() if name != "board" and text != "chessboard"}
        return f'Board("{self.cols}x{self.rows}"' + "".join(f", {name}={_literal(text)}" for name, text in rest.items()) + ")"


def _literal(text: str) -> str:
    try:
        return repr(float(text))
    except ValueError:
        return repr(text)


def _restored(options: dict[str, str]) -> Board:
    return Board(**options)


class BoardDetection:
    """A board in an image, or why there is none. `corners, sigma, found = al.find_board(image, board)` works as well."""

    __slots__ = ("corners", "sigma", "found", "reason")
    corners: Numbers  #: (P, 2) [px]; NaN: not seen
    sigma: Numbers  #: (P, 2, 2) their covariances [px²]; NaN: not seen
    found: bool
    reason: str  #: Why it was not found; "" where it was

    def __init__(self, corners: Numbers, sigma: Numbers, reason: str) -> None:
        self.corners, self.sigma, self.reason, self.found = corners, sigma, reason, not reason

    def __iter__(self) -> abc.Iterator[Any]:
        return iter((self.corners, self.sigma, self.found))

    def __bool__(self) -> bool:
        return self.found

    def __repr__(self) -> str:
        if not self.found:
            return f"BoardDetection(not found: {self.reason})"
        seen = np.isfinite(self.corners[:, 0])
        sigma = np.sqrt(np.median(np.diagonal(self.sigma[seen], axis1=1, axis2=2)))
        return f"BoardDetection({seen.sum()} of {len(seen)} corners, σ {sigma:.3f} px)"


@former(picture="image")
def find_board(image: Any, board: Board) -> BoardDetection:
    """The corners of a board in an image, each with its covariance.

    image  a file, or an array (H, W) or (H, W, 3), uint8 or uint16
    """
    if not isinstance(board, Board):
        raise ValueError(f"board: an alidade.Board is needed, not {type(board).__name__}")
    if isinstance(image, (str, os.PathLike)):
        return BoardDetection(*_alidade.find_in_file(file_name(image, "image"), board._core))
    return BoardDetection(*_alidade.find_in_image(pixels_of(image), board._core))


class BoardFinder:
    """Boards in images that come one by one; `views()` is what al.calibrate(**…) takes."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.size: tuple[int, int] | None = None
        self._found: list[BoardDetection] = []

    @former(picture="image")
    def push(self, image: Any) -> BoardDetection:
        """Looks for the board in an image (H, W) or (H, W, 3); keeps what is found."""
        pixels = pixels_of(image)
        size = pixels.shape[1], pixels.shape[0]
        if self.size not in (None, size):
            raise ValueError(f"the image is {size[0]}x{size[1]}, but those before were {self.size}")
        detection = find_board(pixels, self.board)
        self.size = size
        if detection.found:
            self._found.append(detection)
        return detection

    def __len__(self) -> int:
        return len(self._found)

    def views(self) -> dict[str, Any]:
        """Keyword arguments of al.calibrate: corners, sigma_px, size, board."""
        if not self._found:
            raise ValueError("no board was found yet")
        return {"corners": np.stack([each.corners for each in self._found]),
                "sigma_px": np.stack([each.sigma for each in self._found]), "size": self.size, "board": self.board}

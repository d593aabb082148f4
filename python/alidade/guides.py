"""Guides: what comes in one by one is judged at once, and what to measure next is said."""
from __future__ import annotations

import math
import types
from typing import Any

import numpy as np

from . import _alidade
from .arrays import Numbers, image_size, number, numbers, shown, whole
from .arrays import image as pixels_of
from .board import Board
from .camera import Camera
from .former import former
from .live import OneByOne
from .words import texts_of


def _texts(fields: dict[str, Any]) -> list[tuple[str, list[str]]]:
    return [(name, texts_of(value, name)) for name, value in fields.items() if value is not None]


def _time(t_s: Any) -> float:
    if not math.isfinite(number(t_s, "t_s")):
        raise ValueError(f"t_s: {t_s} is not finite")
    return float(t_s)


def _corners(corners: Any, board: Board | None) -> Numbers:
    """(P, 2) of a board, NaN: not seen."""
    if board is None:
        raise ValueError("corners: no board was given")
    pixels = numbers(corners, "corners")
    if pixels.shape != (board.num_points, 2):
        raise ValueError(f"corners: ({board.num_points}, 2) is needed, but the shape is {pixels.shape}")
    if np.isinf(pixels).any():
        raise ValueError("corners: infinity is no pixel; NaN: not seen")
    return pixels


def _few(values: Any, count: int, name: str) -> list[float]:
    """So many finite numbers; none of None."""
    if values is None:
        return []
    row = numbers(values, name)
    if row.shape != (count,) or not np.isfinite(row).all():
        raise ValueError(f"{name}: {count} finite numbers are needed, but it is {shown(values)}")
    return row.tolist()


def _next(values: dict[str, Any] | None) -> types.SimpleNamespace | None:
    if values is None:
        return None
    values["translation_m"] = np.array(values["translation_m"])
    return types.SimpleNamespace(**values)


class CaptureGuide(OneByOne):
    """Which photos of a board to keep while they are taken, where to hold it next, and when it is enough; the same that
    `alidade calibrate --live` goes by.

    board     what is looked for
    until_px  the goal: 3σ at the worst pixel of the image
    is_video  images follow each other as in a video, and a board is taken when it stands still; else each is a photo
    fields    as of al.calibrate(): model, fixed, prior, …
    """

    def __init__(self, board: Board, *, until_px: float = 0.2, is_video: bool = True, **fields: Any) -> None:
        if not isinstance(board, Board):
            raise ValueError(f"board: an alidade.Board is needed, not {type(board).__name__}")
        self.board = board
        self._core = _alidade.CaptureGuide(board._core, number(until_px, "until_px"), bool(is_video), _texts(fields))

    @former(picture="image")
    def push(self, image: Any, t_s: float) -> types.SimpleNamespace:
        """Looks at an image (H, W) or (H, W, 3) of time t_s, which does not go back. What became of it: taken, and then
        image, the one that counts as a photo from now on: this one, or an earlier one that is more informative, of
        earlier_t_s (None: this one). status ("useful", "moving", "same_pose", "little", "nothing", …), words for the user,
        corners (K, 2) as seen, gain (ln of σ now over σ with it)."""
        pixels = pixels_of(image)
        look = types.SimpleNamespace(**self._core.push(pixels, _time(t_s)))
        if look.taken and look.earlier_t_s is None:
            look.image = look.picture = pixels  # picture: the former name
        return look

    def push_corners(self, corners: Any, size: tuple[int, int], t_s: float) -> types.SimpleNamespace:
        """The same with corners (P, 2) that were found elsewhere, NaN: not seen, in an image of size (width, height); image is
        None."""
        return types.SimpleNamespace(**self._core.push_corners(_corners(corners, self.board), image_size(size), _time(t_s)))

    def forget(self, photo: int) -> None:
        """A photo that was taken counts no more, by its number among them."""
        if not 0 <= whole(photo, "photo") < self.photos:
            raise ValueError(f"photo: there is no photo {photo}, {self.photos} are kept")
        self._core.forget(photo)

    @property
    def state(self) -> types.SimpleNamespace:
        """photos, camera (with its covariance; None before there is one), worst_3sigma_px and worst_px (2,), where that is,
        photos_to_goal (likely still needed; None: not known), next, warnings, is_at_goal."""
        values = self._core.state()
        values["camera"] = None if values["camera"] is None else Camera._of(values["camera"])
        values["worst_px"] = np.array(values["worst_px"])
        values["next"] = _next(values["next"])
        return types.SimpleNamespace(**values)

    @property
    def photos(self) -> int:
        """How many are kept."""
        return self._core.state()["photos"]

    @property
    def next(self) -> types.SimpleNamespace | None:
        """Where to hold the board: words, outline (N, 2) [px], rotation (3, 3) and translation_m (3,) of the board's frame
        in the camera's."""
        return _next(self._core.state()["next"])

    @property
    def is_at_goal(self) -> bool:
        """Whether 3σ is below the goal everywhere."""
        return self._core.state()["is_at_goal"]


class ShotGuide(OneByOne):
    """What to shoot next with a rangefinder beside the camera; each solve is that of al.rangefinder() on all shots.

    camera        a Camera, or its file
    board         whose corners the shots have; None: they have planes or spots alone
    min_range_m, max_range_m, max_tilt_deg   as of al.plan.rangefinder(): where a board can be held
    fields        as of al.rangefinder(): method, sigma_range_m, …
    """

    _WHERE = ("min_range_m", "max_range_m", "max_tilt_deg")

    def __init__(self, camera: Any, board: Board | None = None, **fields: Any) -> None:
        if board is not None and not isinstance(board, Board):
            raise ValueError(f"board: an alidade.Board is needed, not {type(board).__name__}")
        self.board = board
        where = {name: fields.pop(name) for name in self._WHERE if name in fields}
        if not isinstance(camera, Camera):
            camera = Camera.read(camera)
        self._core = _alidade.ShotGuide(camera._core, None if board is None else board._core, _texts(fields), _texts(where))

    def push(self, range_m: float, *, spot: Any = None, corners: Any = None, plane: Any = None,
             sigma_range_m: float | None = None) -> types.SimpleNamespace:
        """A reading [m] and what was seen of it: the laser's spot (2,) [px], the board's corners (P, 2), NaN: not seen, or
        its plane (nx, ny, nz, d) in the camera's frame [m]. The state after it."""
        reading = _few([range_m], 1, "range_m")[0]
        sigma = math.nan if sigma_range_m is None else _few([sigma_range_m], 1, "sigma_range_m")[0]
        seen = np.zeros((0, 2)) if corners is None else _corners(corners, self.board)
        self._core.push(reading, sigma, _few(spot, 2, "spot"), _few(plane, 4, "plane"), seen)
        return self.state

    def undo(self) -> None:
        """The last shot counts no more."""
        self._core.undo()

    @property
    def state(self) -> types.SimpleNamespace:
        """shots, has_beam, origin_m (3,) and direction (3,) in the camera's frame, sigma_origin_m, sentence of the verdict,
        words ("1.5 m away, tilted by 30°, the right side farther") and next: distance_m, tilt_rad, azimuth_rad, rotation
        (3, 3), translation_m (3,); None before there is a beam."""
        values = self._core.state()
        values["origin_m"], values["direction"] = np.array(values["origin_m"]), np.array(values["direction"])
        values["next"] = _next(values["next"])
        return types.SimpleNamespace(**values)


class ViewGuide(OneByOne):
    """Where to look next with heads that rotate, so that their axes become known; each solve is that of al.rig() on all views.

    cameras       by the number of the head: {1: a Camera or its file, …}
    board         what the heads look at, where it stands still
    min_pan_deg, max_pan_deg, min_tilt_deg, max_tilt_deg   where the heads can look, and are to be known
    min_range_m, max_range_m, max_tilt_of_board_deg        where a board can be put
    fields        as of al.rig(): sigma_px, sigma_angle_rad, …
    """

    _WHERE = ("min_pan_deg", "max_pan_deg", "min_tilt_deg", "max_tilt_deg", "min_range_m", "max_range_m", "max_tilt_of_board_deg")

    def __init__(self, cameras: dict[int, Any], board: Board, **fields: Any) -> None:
        if not isinstance(board, Board):
            raise ValueError(f"board: an alidade.Board is needed, not {type(board).__name__}")
        if not isinstance(cameras, dict):
            raise ValueError("cameras: a dict is needed, the cameras by the numbers of their heads: {1: camera}")
        self.board = board
        where = {name: fields.pop(name) for name in self._WHERE if name in fields}
        read = {whole(head, "cameras"): one if isinstance(one, Camera) else Camera.read(one) for head, one in cameras.items()}
        self._core = _alidade.ViewGuide({head: one._core for head, one in read.items()}, board._core, _texts(fields), _texts(where))

    def push(self, head: int, pan_tilt_rad: Any, corners: Any, *, board: int = 1) -> types.SimpleNamespace:
        """What a head's encoders read, (pan, tilt), and the board's corners (P, 2) [px] as its camera saw them then, NaN: not
        seen. board: the number of the position where it stood. The state after it."""
        pan, tilt = _few(pan_tilt_rad, 2, "pan_tilt_rad")
        self._core.push(whole(head, "head"), (pan, tilt), whole(board, "board"), _corners(corners, self.board))
        return self.state

    def undo(self) -> None:
        """The last view counts no more."""
        self._core.undo()

    @property
    def state(self) -> types.SimpleNamespace:
        """views, has_rig, sigma_rad and sigma_m: of where the cameras stand to each other (of one head: its camera after a
        rotation), the worst over the limits; sentence of the verdict, words ("head 1 to pan 12.0°, tilt -5.0°: board 2 in the
        upper left corner of its image") and next: head, pan_tilt_rad (2,), board, is_new_position, gain, outline (N, 2), rotation
        (3, 3), translation_m (3,); None before there is a rig."""
        values = self._core.state()
        if values["next"] is not None:
            values["next"]["pan_tilt_rad"] = np.array(values["next"]["pan_tilt_rad"])
        values["next"] = _next(values["next"])
        return types.SimpleNamespace(**values)

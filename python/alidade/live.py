"""Estimators whose data come one by one; finish() gives what the batch call gives on the same data."""
from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from . import _alidade
from .arrays import Numbers, file_name, image_size, number, numbers, vectors, whole
from .arrays import image as pixels_of
from .camera import Camera
from .former import former
from .job import Progress, files_for_call
from .result import Result
from .words import texts_of


class OneByOne:
    """What takes data one by one stands in a stream: it is neither copied nor pickled. What can be carried elsewhere is
    what finish() gives, and the data that were pushed."""

    def __reduce__(self) -> NoReturn:
        name = type(self).__name__
        raise TypeError(f"a {name} is neither copied nor pickled, as it belongs to a stream: keep what finish() gives, or what was pushed, "
                        f"and push that into another {name}")


def _row(values: Any, sizes: tuple[int, ...], name: str) -> Numbers:
    row = numbers(values, name)
    if row.ndim != 1 or len(row) not in sizes:
        raise ValueError(f"{name}: {' or '.join(map(str, sizes))} numbers are needed, but the shape is {row.shape}")
    if not np.isfinite(row).all():
        raise ValueError(f"{name}: a number is not finite")
    return row


class Tracker(OneByOne):
    """A target followed in space, observation by observation, as al.track() does it.

    rig     rig.yaml, or the result of al.rig()
    fields  as of al.track(): method, sigma_px, …
    """

    def __init__(self, rig: Any, **fields: Any) -> None:
        with files_for_call() as files:
            texts = [(name, texts_of(value, name)) for name, value in fields.items() if value is not None]
            self._core = _alidade.Tracker(file_name(files.path_of(rig, "rig"), "rig"), texts)

    def push(self, head: int, pan_tilt_rad: Any, px: Any, t_capture_s: float, t_arrival_s: float | None = None, *,
             sigma_px: float = 0.0) -> dict[str, Any]:
        """One observation: which head (its id), its angles (2,) [rad], the target's pixel (2,). What became of it: t_s,
        position_m (3,), velocity_m_s (3,) and covariance (6, 6) in the world (None before the start), event, accepted."""
        pan, tilt = _row(pan_tilt_rad, (2,), "pan_tilt_rad")
        u, v = _row(px, (2,), "px")
        capture = number(t_capture_s, "t_capture_s")
        arrival = capture if t_arrival_s is None else number(t_arrival_s, "t_arrival_s")
        return _belief(self._core.push(whole(head, "head"), (pan, tilt), (u, v), capture, arrival, number(sigma_px, "sigma_px")))

    def at(self, t_s: float) -> dict[str, Any] | None:
        """Where the target will be at a time; None where that is not known."""
        step = self._core.at(number(t_s, "t_s"))
        return None if step is None else _belief(step)

    def finish(self, progress: Progress | None = None) -> Result:
        """All that was pushed, as al.track() gives it; more may follow."""
        return Result(self._core.finish(progress))


def _belief(step: dict[str, Any]) -> dict[str, Any]:
    for name, shape in (("position_m", (3,)), ("velocity_m_s", (3,)), ("covariance", (6, 6))):
        if step[name] is not None:
            step[name] = np.array(step[name]).reshape(shape)
    return step


class Observer(OneByOne):
    """Intrinsics of a camera that rotates, row by row, as al.observe() does it by the method hybrid.

    size    (width, height) [px]
    source  "head" (pan, tilt[, roll] [rad]), "rate" (ω x, y[, z] [rad/s], camera frame), "attitude" (w, x, y, z); None: by
            the first row, where 2 numbers are a head's, 3 are rates, 4 an attitude
    camera  an initial guess, and the lens' distortion: a Camera or its file
    fields  as of al.observe(): start, sigma_px, estimate, …
    """

    def __init__(self, size: tuple[int, int] | None = None, *, source: str | None = None, camera: Any = None,
                 **fields: Any) -> None:
        if source not in (None, "head", "rate", "attitude"):
            raise ValueError(f"source: {source!r} is not one of head, rate, attitude")
        self._source = source
        self._core: _alidade.Observer | None = None
        if camera is not None and not isinstance(camera, Camera):
            camera = Camera.read(camera)
        self._camera = None if camera is None else camera._core
        self._texts = [(name, texts_of(value, name)) for name, value in fields.items() if value is not None]
        if size is not None:
            self._texts.append(("size", ["{}x{}".format(*image_size(size))]))

    def push(self, t_s: float, rotation: Any, pixels: Any) -> dict[str, Any]:
        """A row: its time, the rotation, and a pixel of each point (N, 2), NaN: not seen. What is known after it: t_s, fx,
        fy, cx, cy, their sigma_… (NaN: not yet), event."""
        rows, shape = vectors(pixels, 2, "pixels")
        if len(shape) != 1:
            raise ValueError(f"pixels: (N, 2) is needed, one pixel per point, but the shape is {(*shape, 2)}")
        turned = _row(rotation, (2, 3, 4), "rotation")
        if self._core is None:
            self._source = self._source or {2: "head", 3: "rate", 4: "attitude"}[len(turned)]
            self._count, self._length = len(rows), len(turned)
            self._core = _alidade.Observer(self._source, len(turned) == 3, len(rows), self._texts, self._camera)
        if len(rows) != self._count:
            raise ValueError(f"pixels: the first row had {self._count} points, this has {len(rows)}")
        if len(turned) != self._length:
            raise ValueError(f"rotation: the first row had {self._length} numbers, this has {len(turned)}")
        if (len(turned) == 4) != (self._source == "attitude"):
            raise ValueError(f"rotation: {len(turned)} numbers are no {self._source}")
        if np.isinf(rows).any():
            raise ValueError("pixels: a value is infinite; what is not seen is NaN")
        return self._core.push(number(t_s, "t_s"), turned.tolist() + [0.0] * (3 - len(turned)), rows)

    def finish(self, progress: Progress | None = None) -> Result:
        """Of all rows so far, as al.observe() gives it; more may follow."""
        if self._core is None:
            raise ValueError("no row was pushed yet")
        return Result(self._core.finish(progress))


class Localizer(OneByOne):
    """The path of a moving camera, frame by frame, as al.localize() does it.

    camera  the camera, a Camera or its file
    target  what gives scale and the map's frame: target.yaml, or its content as a dict
    start   where the camera starts, how fast, how sure: start.yaml, or its content
    map     instead of a target, the map that an earlier run has left: map.yaml
    fields  as of al.localize(): sigma_px, sigma_a_m_s2, …
    """

    def __init__(self, camera: Any, *, target: Any = None, start: Any = None, map: Any = None,
                 **fields: Any) -> None:
        self._camera = camera if isinstance(camera, Camera) else Camera.read(camera)
        self._texts = [(name, texts_of(value, name)) for name, value in fields.items() if value is not None]
        if map is not None and target is not None:
            raise ValueError("map and target both say the map's frame: give one of them")
        self._target, self._start, self._map = target, start, map
        self._frame = 0
        self._core: _alidade.Localizer | None = None

    def _begin(self, is_of_images: bool) -> _alidade.Localizer:
        if self._core is None:
            with files_for_call() as files:
                target, start, saved = (b"" if value is None else file_name(files.path_of(value, name), name) for value, name in
                                        ((self._target, "target"), (self._start, "start"), (self._map, "map")))
                self._core = _alidade.Localizer(self._camera._core, target, is_of_images, start, saved, self._texts)
        return self._core

    def push(self, t_s: float, ids: Any, pixels: Any) -> dict[str, Any]:
        """A frame of observations: numbers of the points (N,) and their pixels (N, 2). Where the camera is after it: frame,
        t_s, event, position_m (3,), quaternion_wxyz (4,), covariance (6, 6) of translation [m] and rotation [rad] (None
        before the start)."""
        rows, shape = vectors(pixels, 2, "pixels")
        numbered = np.asarray(ids)
        if numbered.dtype.kind == "f" and np.array_equal(np.trunc(numbered), numbered) and np.all(np.abs(numbered) < 2.0**53):
            numbered = numbered.astype(np.int64)  # as of a table's column; [] is of floating numbers, too
        if numbered.shape != shape or numbered.ndim != 1 or numbered.dtype.kind not in "iu":
            raise ValueError(f"ids: a whole number per pixel is needed, but the shape is {numbered.shape} of {numbered.dtype}")
        step = self._begin(False).push_points(self._frame, number(t_s, "t_s"), numbered.tolist(), rows)
        self._frame += 1
        return _pose(step)

    @former(picture="image")
    def push_image(self, t_s: float, image: Any) -> dict[str, Any]:
        """A frame (H, W), uint8, grey. Where the camera is after it, as push() says it."""
        pixels = pixels_of(image)
        if pixels.ndim != 2 or pixels.dtype != np.uint8:
            raise ValueError("image: grey, (H, W) of uint8, is needed")
        step = self._begin(True).push_image(self._frame, number(t_s, "t_s"), pixels)
        self._frame += 1
        return _pose(step)

    def finish(self, progress: Progress | None = None) -> Result:
        """All that was pushed, as al.localize() gives it; more may follow."""
        if self._core is None:
            raise ValueError("no frame was pushed yet")
        return Result(self._core.finish(progress))


def _pose(step: dict[str, Any]) -> dict[str, Any]:
    for name in ("position_m", "quaternion_wxyz"):
        if step[name] is not None:
            step[name] = np.array(step[name])
    return step

"""A lens with its image size and what is known of it."""
from __future__ import annotations

import math
import os
import types
import warnings
from typing import Any, Callable

import numpy as np

from . import _alidade
from .arrays import Numbers, file_name, image_size, numbers, vectors
from .arrays import image as pixels_of
from .former import former
from .words import suggestion


#: What other libraries call it.
_CALLED_ELSEWHERE = {**dict.fromkeys(("K", "dist", "D", "mtx", "camera_matrix", "dist_coeffs"), "K, dist = camera.to_opencv()"),
                     "save": "write(file) writes one"}


class Camera:
    """A camera: model, image size, parameters by name (`camera.fx`), their covariance. Never changes.

    model       "pinhole", "brown" (OpenCV's k1 k2 p1 p2 k3), "kannala_brandt" (fisheye) or "flat_port"
    size        (width, height) [px]
    covariance  (P, P) over `parameter_names` in their order; None: not known
    parameters  fx, fy, cx, cy [px], k1, … by name; what is not named is 0
    """

    __slots__ = ("_core",)
    _core: _alidade.Camera

    def __init__(self, model: str = "brown", size: tuple[int, int] = (0, 0), *, covariance: Any = None,
                 rms_px: float = 0.0, source: str = "", **parameters: float) -> None:
        _refuse_file(model)
        width, height = image_size(size)
        names = _alidade.parameter_names(model)
        for name in parameters:
            if name not in names:
                raise ValueError(f"{name}: a {model} lens has {', '.join(names)}")
        values = [float(parameters.get(name, 0.0)) for name in names]
        if not all(math.isfinite(value) for value in values):
            raise ValueError("a parameter of the lens is not a finite number")
        self._core = _alidade.Camera(model, width, height, values, _square(covariance, len(names)), rms_px, source)

    @classmethod
    def _of(cls, core: _alidade.Camera) -> Camera:
        camera = cls.__new__(cls)
        camera._core = core
        return camera

    @classmethod
    def read(cls, file: str | os.PathLike[str]) -> Camera:
        """A camera file of any known format: alidade, OpenCV, ROS, Kalibr, mrcal, COLMAP. "camchain.yaml:cam1" chooses.
        A file of OpenCV that does not say whose its four coefficients are is read as brown, with a warning:
        "file.yml:fisheye" or "file.yml:brown" decides."""
        name = file_name(file)
        camera = cls._of(_alidade.read_camera(name))
        if doubt := _alidade.lens_doubt(name):
            said = os.fsdecode(name)
            warnings.warn(f"{said}: {doubt}; say which lens it is: {said}:fisheye, or {said}:brown", stacklevel=2)
        return camera

    def write(self, file: str | os.PathLike[str], format: str = "alidade", *, lossy: bool = False) -> None:
        """Writes "alidade", "opencv", "ros", "kalibr", "mrcal" or "colmap". What the format cannot hold is a ValueError,
        unless `lossy`."""
        self._core.write(file_name(file), format, lossy)

    @classmethod
    def from_opencv(cls, K: Any, dist: Any = None, size: tuple[int, int] = (0, 0), covariance: Any = None, *,
                    fisheye: bool = False) -> Camera:
        """From OpenCV's camera matrix (3, 3) and coefficients k1 k2 p1 p2 k3 (0, 4, 5, 8, 12 or 14 of them; those beyond
        k3 must be 0), or k1…k4 of cv2.fisheye; size (width, height); covariance over
        `parameter_names`, or (9, 9) over fx fy cx cy k1 k2 p1 p2 k3 ((8, 8) of a fisheye: k1…k4), without skew, as OpenCV counts."""
        matrix = numbers(K, "K")
        if matrix.shape != (3, 3):
            raise ValueError(f"K: (3, 3) numbers are needed, but the shape is {matrix.shape}")
        if not np.isfinite(matrix).all():
            raise ValueError("K: a number is not finite")
        if matrix[1, 0] != 0.0 or matrix[2].tolist() != [0.0, 0.0, 1.0]:
            raise ValueError("K: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] is needed")
        if matrix[0, 1] != 0.0:
            raise ValueError(f"K: OpenCV's functions ignore a skew, K[0, 1] is {matrix[0, 1]:g}; Camera(…, skew=…) has one")
        width, height = image_size(size)
        coefficients = [] if dist is None else numbers(dist, "dist").ravel().tolist()
        if not all(math.isfinite(each) for each in coefficients):
            raise ValueError("dist: a coefficient is not a finite number")
        focal_centre = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
        if not (focal_centre[0] > 0.0 and focal_centre[1] > 0.0):
            raise ValueError("K: the focal lengths K[0, 0] and K[1, 1] must be above zero")
        core = _alidade.camera_from_opencv(focal_centre, coefficients, fisheye, width, height)
        if covariance is None:
            return cls._of(core)
        square = _square(_in_our_order(covariance, core), len(core.names))
        return cls._of(_alidade.Camera(core.model, width, height, core.values, square, 0.0, ""))

    def to_opencv(self) -> tuple[Numbers, Numbers]:
        """K (3, 3) and coefficients: k1 k2 p1 p2 k3, of a kannala_brandt lens k1…k4 of cv2.fisheye. A lens with skew is a
        ValueError: OpenCV's functions ignore it."""
        if not self._core.is_central:
            raise ValueError(f"OpenCV has no {self.model} lens")
        fx, fy, cx, cy, skew = self._core.values[:5]
        if skew != 0.0:
            raise ValueError(f"OpenCV's functions ignore a skew, this lens has {skew:g} px")
        K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        return K, np.array(self._core.distortion or [0.0] * 5)

    @property
    def model(self) -> str:
        """Name of the lens model."""
        return self._core.model

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) [px]."""
        return self._core.width, self._core.height

    @property
    def width(self) -> int:
        """[px]"""
        return self._core.width

    @property
    def height(self) -> int:
        """[px]"""
        return self._core.height

    @property
    def rms_px(self) -> float:
        """RMS residual of the calibration that made it [px]; 0 where not known."""
        return self._core.rms_px

    @property
    def source(self) -> str:
        """Where it came from, for a user."""
        return self._core.source

    @property
    def is_central(self) -> bool:
        """Whether all its rays meet in the camera's origin: true of all but flat_port."""
        return self._core.is_central

    @property
    def parameter_names(self) -> list[str]:
        """The P parameters, in the order of `parameters` and `covariance`: fx, fy, cx, cy, skew, k1, …"""
        return self._core.names

    @property
    def parameters(self) -> Numbers:
        """(P,) values."""
        return np.array(self._core.values)

    @property
    def covariance(self) -> Numbers | None:
        """(P, P) over `parameter_names`, rows of fixed parameters are 0; None where not known."""
        covariance = self._core.covariance
        return covariance if covariance.size else None

    @property
    def sigma(self) -> types.SimpleNamespace:
        """One standard deviation of each parameter, by name: `camera.sigma.fx`; NaN where not known."""
        covariance = self.covariance
        count = len(self.parameter_names)
        sigmas = np.full(count, np.nan) if covariance is None else np.sqrt(np.diag(covariance))
        return types.SimpleNamespace(**dict(zip(self.parameter_names, sigmas.tolist())))

    def project(self, points: Any, *, jacobians: bool = False) -> Any:
        """Pixels (..., 2) of points (..., 3) in the camera frame [m]; NaN behind the camera and outside the valid domain.

        With `jacobians`: pixels, their derivatives by the point (..., 2, 3) [px/m] and by the lens (..., 2, P)."""
        rows, shape = vectors(points, 3, "points")
        if not jacobians:
            return self._core.project(rows).reshape(*shape, 2)
        pixels, by_point, by_lens = self._core.project_with_jacobians(rows)
        return (pixels.reshape(*shape, 2), by_point.reshape(*shape, 2, 3),
                by_lens.reshape(*shape, 2, len(self.parameter_names)))

    def unproject(self, pixels: Any) -> Numbers:
        """Unit rays (..., 3) in the camera frame of pixels (..., 2); NaN where no point is seen. Of a flat_port camera the
        direction in water alone: see rays()."""
        rows, shape = vectors(pixels, 2, "pixels")
        return self._core.rays(rows)[1].reshape(*shape, 3)

    def rays(self, pixels: Any) -> tuple[Numbers, Numbers]:
        """Origins (..., 3) [m] and unit directions (..., 3) of what pixels (..., 2) see, in the camera frame."""
        rows, shape = vectors(pixels, 2, "pixels")
        origins, directions = self._core.rays(rows)
        return origins.reshape(*shape, 3), directions.reshape(*shape, 3)

    def sigma_px(self, pixels: Any, distance_m: float = math.inf) -> Numbers:
        """Standard deviation (...) [px] of where a fixed point is seen at pixels (..., 2), by the camera's covariance, after
        the motion that fits best is taken out: at infinity a rotation, at `distance_m` a translation as well. NaN without a
        covariance."""
        rows, shape = vectors(pixels, 2, "pixels")
        if not distance_m > 0.0:
            raise ValueError(f"distance_m: {distance_m} is not above 0")
        return self._core.sigma_px(rows, float(distance_m)).reshape(shape)

    @former(picture="image")
    def undistort(self, image: Any) -> Any:
        """The image (H, W) or (H, W, 3) as the pinhole camera undistorted() sees it."""
        pixels = pixels_of(image)
        if pixels.shape[:2] != (self.height, self.width):
            raise ValueError(f"the image is {pixels.shape[1]}x{pixels.shape[0]}, the camera {self.width}x{self.height}")
        return self._core.undistort(pixels)

    def undistorted(self) -> Camera:
        """The pinhole camera of the same size of which undistort() makes images."""
        return Camera._of(self._core.undistorted())

    def diff(self, other: Camera, distance_m: float = math.inf) -> dict[str, Any]:
        """How far apart two cameras of one image size are over the image, after the motion that fits best."""
        found = self._core.diff(other._core, float(distance_m))
        if found is None:
            raise ValueError("the cameras cannot be compared: sizes differ, or they see nothing in common")
        return found

    def text(self, format: str = "alidade", *, lossy: bool = False) -> str:
        """What write() writes."""
        return self._core.text(format, lossy)

    def __getattr__(self, name: str) -> float:
        if not name.startswith("_"):
            names = self._core.names
            if name in names:
                return self._core.values[names.index(name)]
        if name.startswith("_"):
            raise AttributeError(f"a camera has no '{name}'")
        other = _CALLED_ELSEWHERE.get(name)
        hint = f"; {other}" if other else suggestion(name, dir(self))
        raise AttributeError(f"a {self._core.model} camera has no '{name}'{hint}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.parameter_names})

    def _state(self) -> tuple[Any, ...]:
        core = self._core
        return core.model, self.size, core.values, core.rms_px, core.source, core.covariance.tolist()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Camera):
            return NotImplemented
        return bool(self._state() == other._state())

    def __hash__(self) -> int:
        return hash((self.model, self.size, tuple(self._core.values)))

    def __reduce__(self) -> tuple[Callable[..., Camera], tuple[Any, ...]]:
        core = self._core
        return _restored, (core.model, core.width, core.height, core.values, core.covariance, core.rms_px, core.source)

    def __copy__(self) -> Camera:
        return self

    def __deepcopy__(self, memo: Any) -> Camera:
        return self

    def _rows(self) -> list[tuple[str, float, float]]:
        sigma = vars(self.sigma)
        return [(name, value, sigma[name]) for name, value in zip(self.parameter_names, self._core.values)
                if not (name == "skew" and value == 0.0)]

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value:.6g}" for name, value, _ in self._rows())
        return f"Camera({self.model!r}, {self.size}, {values})"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th>{name}</th><td>{value:.6g}</td><td>{'' if math.isnan(s) else f'± {3 * s:.2g}'}</td></tr>"
                       for name, value, s in self._rows())
        return f"<table><caption>{self.model}, {self.width}×{self.height} px, ± 3σ</caption>{rows}</table>"


def _refuse_file(model: Any) -> None:
    """A file instead of a lens model: says how it is read."""
    file = str(model)
    if not isinstance(model, str) or os.sep in file or os.path.splitext(file)[1]:
        raise ValueError(f"model: {file!r} is no lens model; al.Camera.read({file!r}) reads a camera file")


def _restored(model: str, width: int, height: int, values: list[float], covariance: Numbers, rms_px: float,
              source: str) -> Camera:
    return Camera._of(_alidade.Camera(model, width, height, values, covariance, rms_px, source))


def _in_our_order(covariance: Any, core: Any) -> Any:
    """A covariance without the skew, which OpenCV has not, with it: fixed."""
    names = [name for name in core.names if name != "skew"]
    square = numbers(covariance, "covariance")
    if "skew" not in core.names or square.shape != (len(names), len(names)):
        return covariance
    opencv = [name for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4") if name in names]
    at = [core.names.index(name) for name in opencv]
    full = np.zeros((len(core.names), len(core.names)))
    full[np.ix_(at, at)] = square
    return full


def _square(covariance: Any, count: int) -> Numbers:
    """A covariance as (count, count); empty where there is none."""
    if covariance is None:
        return np.zeros((0, 0))
    square = numbers(covariance, "covariance")
    if square.shape != (count, count):
        raise ValueError(f"covariance: ({count}, {count}) is needed, but the shape is {square.shape}")
    if not np.isfinite(square).all() or not np.allclose(square, square.T, rtol=1e-9, atol=0.0):
        raise ValueError("covariance: it must be finite and symmetric")
    if (np.diag(square) < 0.0).any():
        raise ValueError("covariance: a variance is below 0")
    return square

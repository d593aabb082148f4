"""What comes in as arrays is checked here, and refused in one line."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:  # costs a fifth of the import
    import numpy.typing as npt

    Numbers = npt.NDArray[np.float64]
else:
    Numbers = np.ndarray


def shown(value: Any) -> str:
    """A value in a message: in one line, and short."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def name_shown(path: Any) -> str:
    """The name of a file in a message: in one line, with nothing that a terminal obeys."""
    return "".join(each if each.isprintable() else " " for each in str(path))


def file_name(path: Any, name: str = "file") -> bytes:
    """A path as the system's bytes, which need not be UTF-8."""
    file = os.fsencode(path)
    if b"\0" in file:
        raise ValueError(f"{name}: {shown(path)} holds a zero byte, which no file's name does")
    return file


def folder_name(path: Any) -> bytes:
    """Of a folder to write into: an empty one would be where the program runs."""
    folder = file_name(path, "folder")
    if not folder:
        raise ValueError("folder: is empty; a folder is needed")
    return folder


def number(value: Any, name: str) -> float:
    """One number; whether it is finite is for who asked."""
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        return float(value)
    raise ValueError(f"{name}: a number is needed, not {shown(value)}")


def whole(value: Any, name: str) -> int:
    """One whole number that fits into 32 bits."""
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and abs(int(value)) < 1 << 31:
        return int(value)
    raise ValueError(f"{name}: a whole number is needed, not {shown(value)}")


def plain(value: Any) -> Any:
    """Of numpy's numbers and arrays Python's own, as json.dumps(default=plain) asks for them."""
    if isinstance(value, (np.generic, np.ndarray)) and value.dtype.kind in "biufU":
        return value.tolist()
    raise TypeError(f"{shown(value)} is neither a number nor a text")


def unmasked(values: Any) -> npt.NDArray[Any]:
    """Of a masked array its numbers, NaN where they are masked; others as they are."""
    if isinstance(values, np.ma.MaskedArray) and values.dtype.kind in "iuf" and np.ma.getmaskarray(values).any():
        return np.where(np.ma.getmaskarray(values), np.nan, np.asarray(values.data, dtype=np.float64))
    return np.asarray(values)


def numbers(values: Any, name: str) -> Numbers:
    """`values` as a C-contiguous float64 array; a copy only where it is none. What is masked is NaN."""
    try:
        array = unmasked(np.asanyarray(values))
    except ValueError:
        raise ValueError(f"{name}: rows of different lengths are no array") from None
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: numbers are needed, not {array.dtype}")
    return np.asarray(array, dtype=np.float64, order="C")


def vectors(values: Any, size: int, name: str) -> tuple[Numbers, tuple[int, ...]]:
    """As rows, (N, size), with the shape of what stood before the last axis."""
    array = numbers(values, name)
    if array.ndim == 0 or array.shape[-1] != size:
        raise ValueError(f"{name}: the last axis must have {size} numbers, but the shape is {array.shape}")
    return array.reshape(-1, size), array.shape[:-1]


def image(values: Any, name: str = "image") -> npt.NDArray[Any]:
    """An image (H, W), or (H, W, 3) in OpenCV's order (blue first), uint8 or uint16."""
    if isinstance(values, (str, os.PathLike)):
        raise ValueError(f"{name}: an array is needed, not a file; cv2.imread({os.fspath(values)!r}) reads one")
    array = np.asarray(values)
    if array.dtype == np.dtype(np.uint16).newbyteorder():  # of the other order of bytes, as FITS and some TIFFs have it
        array = array.astype(np.uint16)
    if array.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{name}: an image is uint8 or uint16, not {array.dtype}")
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[:, :, 0]
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (3, 4)):
        raise ValueError(f"{name}: an image is (H, W) or (H, W, 3), but the shape is {array.shape}")
    if array.size == 0:
        raise ValueError(f"{name}: the image is empty, its shape is {array.shape}")
    return np.ascontiguousarray(array)


def image_size(size: Any, name: str = "size") -> tuple[int, int]:
    """(width, height) [px], or "640x480"."""
    try:
        width, height = size.lower().split("x") if isinstance(size, str) else size
        pair = int(width), int(height)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}: {shown(size)} is not (width, height), for example (640, 480)") from None
    if min(pair) < 1 or max(pair) > 200000:
        raise ValueError(f"{name}: {shown(size)} is not (width, height), for example (640, 480)")
    return pair

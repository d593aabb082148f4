"""A pan-tilt head that is connected."""
from __future__ import annotations

import math
from typing import Any, NoReturn

from . import _alidade
from .arrays import file_name, name_shown
from .former import former
from .job import Progress, files_for_call
from .result import Result

_FREE = (-1e9, 1e9)


class Head:
    """A head by its URL: rotctl://HOST:PORT, onvif://USER@HOST, indi://HOST:PORT/DEVICE, sim://?seed=3. Pan > 0 turns left,
    tilt > 0 up. It is asked until `move=True` says that it may be moved, and stopped where the `with` ends:

        with al.Head("rotctl://127.0.0.1:4533", move=True, pan_range_rad=(-1, 1), tilt_range_rad=(0, 0.7)) as head:
            head.command((0.2, 0.1))

    password_file   its first line is the password of who is named in the URL; no password stands in a URL
    pan_range_rad, tilt_range_rad   where it may go, (low, high); None: as far as it says that it can
    """

    def __init__(self, url: str, *, move: bool = False, password_file: Any = None,
                 pan_range_rad: tuple[float, float] | None = None,
                 tilt_range_rad: tuple[float, float] | None = None) -> None:
        self._url, self._move, self._password_file = url, move, password_file
        self._ranges = {"pan": _range(pan_range_rad, "pan_range_rad"), "tilt": _range(tilt_range_rad, "tilt_range_rad")}
        password = ""
        if password_file is not None:
            try:
                with open(password_file, encoding="utf-8") as file:
                    password = file.readline().rstrip("\r\n")
            except OSError as error:
                raise ValueError(f"{name_shown(password_file)}: {error.strerror}") from None
        self._core: _alidade.Head | None = _alidade.Head(url, password, move, self._ranges["pan"] or _FREE,
                                                         self._ranges["tilt"] or _FREE)

    def __enter__(self) -> Head:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Head is neither copied nor pickled, as it is a connection: open another one by its URL")

    def close(self) -> None:
        """Stops it, and lets it go."""
        core, self._core = self._core, None
        if core is not None:
            core.stop()

    @property
    def limits(self) -> dict[str, Any]:
        """low_rad and high_rad, (pan, tilt): where it may go; are_given: by the head itself; info: what it calls itself."""
        return self._open().limits()

    def position(self) -> dict[str, Any]:
        """Where it says that it is: t_s (since 1970, the midpoint of question and answer), wait_s, pan_tilt_rad (pan, tilt)."""
        return self._open().position()

    def command(self, pan_tilt_rad: tuple[float, float]) -> float:
        """Sends it there, and comes back at once: when it was sent. ValueError: outside of its limits, not finite."""
        pan, tilt = pan_tilt_rad
        return self._open().command((float(pan), float(tilt)))

    def stop(self) -> None:
        """It stands."""
        self._open().stop()

    def identify(self, progress: Progress | None = None) -> Result:
        """Its model, as `alidade head URL --identify --move`: rate, acceleration, latency, backlash, …"""
        return self._run(["--identify"], progress)

    @former(most_s="max_s")
    def calibrate(self, stream: str, *, until: str | None = None, max_s: float | None = None,
                  progress: Progress | None = None) -> Result:
        """Its camera, as `alidade head URL --stream STREAM --calibrate --move`. until: "0.5%"."""
        words = [f"--stream={stream}", "--calibrate"]
        words += [f"--until={until}"] if until is not None else []
        words += [f"--most={max_s}"] if max_s is not None else []
        return self._run(words, progress)

    @former(most_s="max_s")
    def follow(self, stream: str, look: str, rig: Any, *, latency_s: float | None = None, delay_s: float | None = None,
               max_s: float | None = None, progress: Progress | None = None) -> Result:
        """Follows a target by its appearance ("bright", "colour:230,70,20", "marker:DICT_4X4_50:7"), as `alidade head URL --stream STREAM
        --rig RIG --follow LOOK --move`. rig: rig.yaml of calibrate(), or its result."""
        words = [f"--stream={stream}", f"--follow={look}"]
        words += [f"--latency={latency_s}"] if latency_s is not None else []
        words += [f"--delay={delay_s}"] if delay_s is not None else []
        words += [f"--most={max_s}"] if max_s is not None else []
        with files_for_call() as files:
            return self._run([*words, f"--rig={files.path_of(rig, 'rig')}"], progress)

    def _open(self) -> _alidade.Head:
        if self._core is None:
            raise ValueError(f"{self._url}: the head was let go")
        return self._core

    def _run(self, words: list[str], progress: Progress | None) -> Result:
        if not self._move:
            raise ValueError(f"{self._url}: may not move; open it with move=True")
        self._open().stop()
        for axis, limits in self._ranges.items():
            if limits is not None:
                low, high = (math.degrees(value) for value in limits)
                words.append(f"--{axis}-range={low:.9f},{high:.9f}")
        if self._password_file is not None:
            words.append(f"--password-file={self._password_file}")
        return Result(_alidade.run_command([file_name(word, "head") for word in ("head", self._url, "--move", *words)], progress))


def _range(limits: tuple[float, float] | None, name: str) -> tuple[float, float] | None:
    if limits is None:
        return None
    low, high = (float(value) for value in limits)
    if not low <= high or not math.isfinite(high - low):
        raise ValueError(f"{name}: (low, high) [rad] is needed, not {limits}")
    return low, high

"""Python values as the texts that fields and options take."""
from __future__ import annotations

import os
from collections import abc
from typing import Any

import numpy as np


def suggestion(name: str, known: abc.Iterable[str]) -> str:
    """"; did you mean 'x'?" of what is called nearly so; empty where nothing is."""
    import difflib  # only where something is wrong
    near = difflib.get_close_matches(name, [one for one in known if not one.startswith("_")], 1, 0.6)
    return f"; did you mean '{near[0]}'?" if near else ""


def texts_of(value: Any, name: str, pair: bool = False) -> list[str]:
    """One text, or those of a list; `pair`: (9, 6) is "9x6"."""
    if isinstance(value, abc.Mapping):  # prior={"fx": (650, 5)}
        return [",".join(f"{key}={_prior(each, name)}" for key, each in value.items())]
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple, set)):
        texts = [text_of(each, name) for each in value]
        return ["x".join(texts)] if pair else texts
    text = text_of(value, name)
    return [text] if pair or not isinstance(value, str) else text.split(",") if name in ("fixed", "fix", "free") else [text]


def _prior(value: Any, name: str) -> str:
    try:
        mean, sigma = value
    except (TypeError, ValueError):
        raise ValueError(f"{name}: {value!r} is not (value, sigma)") from None
    return f"{text_of(mean, name)}:{text_of(sigma, name)}"


def text_of(value: Any, name: str) -> str:
    """A number, a word or a path as text."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    raise ValueError(f"{name}: {type(value).__name__} is neither a number nor a text")

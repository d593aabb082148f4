"""Keywords that had another name: the old one is accepted for one release."""
from __future__ import annotations

import functools
import warnings
from typing import Any, Callable, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def former(**names: str) -> Callable[[Function], Function]:
    """former(old="new"): calls with old=… are calls with new=…, with a DeprecationWarning."""

    def renamed(function: Function) -> Function:
        @functools.wraps(function)
        def called(*args: Any, **words: Any) -> Any:
            for old, new in names.items():
                if old not in words:
                    continue
                if new in words:
                    raise TypeError(f"{function.__name__}(): {old} and {new} are the same")
                warnings.warn(f"{function.__name__}(): {old} is now {new}", DeprecationWarning, stacklevel=2)
                words[new] = words.pop(old)
            return function(*args, **words)

        return cast(Function, called)

    return renamed

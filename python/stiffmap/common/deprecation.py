"""Earlier names of arguments and functions: they work, and a DeprecationWarning at the caller's line says the new name."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from functools import wraps
from types import FrameType
from typing import Any, ParamSpec, TypeVar, cast

GONE = "stiffmap 0.2"
"""Version without the earlier names."""

P = ParamSpec("P")
R = TypeVar("R")


def warn_renamed(old: str, new: str) -> None:
    """Warn, at the line that called stiffmap, that `old` goes and what replaces it."""
    text = f"{old} is deprecated and will be removed in {GONE}: use {new}"
    warnings.warn(text, DeprecationWarning, stacklevel=frames_of_this_package())


def renamed(**names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let keywords have their earlier names: ``renamed(old="new")``. TypeError where both are given."""

    def accept(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **keywords: P.kwargs) -> R:
            given = cast("dict[str, Any]", keywords)
            for old in names.keys() & given.keys():
                name, new = function.__name__, names[old]
                if new in given:
                    raise TypeError(f"{name}() got both {new!r} and {old!r}, its deprecated name")
                warn_renamed(f"{name}({old}=)", f"{name}({new}=)")
                given[new] = given.pop(old)
            return function(*args, **keywords)

        call.__deprecated_names__ = names  # type: ignore[attr-defined]  # read by the test of signatures
        return call

    return accept


def frames_of_this_package() -> int:
    """How many callers, from the function that asks on, are in stiffmap itself."""
    frame: FrameType | None = sys._getframe(1)
    count = 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "stiffmap":
        frame, count = frame.f_back, count + 1
    return count

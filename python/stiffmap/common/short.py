"""Results that show themselves in one line: plain values as they are, arrays by their shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
MOST_NUMBERS = 3
LONGEST_TEXT = 40
MOST_FIELDS = 8


def short_repr(cls: type[T]) -> type[T]:
    """Decorator of a dataclass: its repr becomes one line."""

    def line(self: Any) -> str:
        shown = [f"{f.name}={shown_as(getattr(self, f.name))}" for f in fields(self)[:MOST_FIELDS] if f.repr]
        more = ", …" if len(fields(self)) > MOST_FIELDS else ""
        return f"<{type(self).__name__} {', '.join(shown)}{more}>"

    cls.__repr__ = line  # type: ignore[method-assign]
    return cls


def shown_as(value: Any) -> str:
    """A value in a few characters."""
    if isinstance(value, np.ndarray):
        if value.size <= MOST_NUMBERS and value.dtype.kind in "fiub":
            text = ", ".join(shown_as(v) for v in value.ravel().tolist())
            return text if value.ndim == 0 else f"[{text}]"
        return "(" + ", ".join(map(str, value.shape)) + ")"
    if isinstance(value, bool | int | np.bool_ | np.integer) or value is None:
        return str(value)
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= LONGEST_TEXT else value[: LONGEST_TEXT - 1] + "…")
    if isinstance(value, Mapping | list | tuple):
        if len(value) <= MOST_NUMBERS and all(isinstance(v, str | float | int | None) for v in value):
            return "[" + ", ".join(shown_as(v) for v in value) + "]"
        return f"{len(value)} entries" if len(value) != 1 else "1 entry"
    return f"<{type(value).__name__}>"

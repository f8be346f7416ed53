"""Results that show themselves: in one line, plain values as they are and arrays by their shapes; in notebooks as small tables, long ones
folded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from html import escape
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


def first_of(names: Sequence[str], most: int = 12, between: str = ", ") -> str:
    """Names in a row, the first of very many."""
    return between.join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


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


MOST_ROWS = 8
CELL = "style='text-align:left;padding:2px 10px'"


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """HTML table with escaped cells; beyond some rows the rest is folded."""
    told = [list(map(str, row)) for row in rows]
    top = "".join(f"<th {CELL}>{escape(h)}</th>" for h in head)
    body = ["<tr>" + "".join(f"<td {CELL}>{escape(c)}</td>" for c in row) + "</tr>" for row in told]
    out = f"<table><thead><tr>{top}</tr></thead><tbody>{''.join(body[:MOST_ROWS])}</tbody></table>"
    if len(body) > MOST_ROWS:
        rest = f"<table><tbody>{''.join(body[MOST_ROWS:])}</tbody></table>"
        out += f"<details><summary>{len(body) - MOST_ROWS} more</summary>{rest}</details>"
    return out


def titled(title: str, *parts: str) -> str:
    """A block with a bold first line."""
    return f"<div><b>{escape(title)}</b>{''.join(parts)}</div>"


def machine_html(d: Any, actuators: Sequence[str], points: Sequence[str]) -> str:
    """Title, what is commanded, elements of each leg."""
    rows = [("drives", ", ".join(actuators)), ("commanded", ", ".join(d.task) or "x, y, z, rx, ry, rz")]
    if d.workspace is not None:
        box = zip("xyz", *d.workspace, strict=True)
        rows.append(("workspace, mm", "; ".join(f"{a} {1e3 * u:g} … {1e3 * v:g}" for a, u, v in box)))
    rows.append(("points", ", ".join(points)))
    effects = "; ".join(f"{e.kind} of {e.element} {' '.join(e.legs)}" for e in d.effects)
    rows.append(("effects", effects or "none"))
    parts = [(f"leg {leg.name}", " → ".join(e.name for e in leg.elements)) for leg in d.legs]
    return titled(
        f"{d.name}: {d.title}" if d.title else d.name,
        table(("", ""), rows),
        table(("chain", "elements"), parts),
    )

"""Small tables for notebooks: what an object says of itself, long ones folded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

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

"""Small tables for notebooks: what an object says of itself, long ones folded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

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

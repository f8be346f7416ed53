"""Small tables for notebooks: what an object says of itself, long ones folded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from stiffmap.budget import DeflectionBudget
    from stiffmap.diagnosis import Diagnosis
    from stiffmap.experiment import Experiment, Residual
    from stiffmap.link.result import Link
    from stiffmap.machine import Machine

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


def machine_html(m: Machine) -> str:
    """Title, what is commanded, elements of each leg."""
    d = m.description
    rows: list[tuple[str, str]] = [("legs", ", ".join(m.legs)), ("drives", ", ".join(m.actuators))]
    rows.append(("commanded", ", ".join(d.task) or "x, y, z, rx, ry, rz"))
    if d.workspace is not None:
        low, high = 1e3 * m.workspace
        rows.append(
            (
                "workspace, mm",
                "; ".join(f"{a} {u:g} … {v:g}" for a, u, v in zip("xyz", low, high, strict=True)),
            )
        )
    rows.append(("points", ", ".join(m.points)))
    rows.append(
        ("effects", "; ".join(f"{e.kind} of {e.element} {' '.join(e.legs)}" for e in d.effects) or "none")
    )
    parts = [(f"leg {leg.name}", " → ".join(e.name for e in leg.elements)) for leg in d.legs]
    return titled(f"{m.name}: {d.title}", table(("", ""), rows), table(("chain", "elements"), parts))


def budget_html(b: DeflectionBudget) -> str:
    """Shares with bars."""
    size = 1e6 * float(np.linalg.norm(b.displacement[:3]))
    rows = [(n, f"{100 * s:.1f} %", ", ".join(f"{v:.1f}" for v in 1e6 * c[:3])) for n, c, s in b.ranked()]
    return titled(f"{size:.1f} µm at {b.point}", table(("element", "share", "dx, dy, dz, µm"), rows))


def experiment_html(e: Experiment) -> str:
    """What was measured, and three rows."""
    facts = [
        ("quantity", e.quantity),
        ("rows, poses", f"{len(e)}, {int(e.groups.max()) + 1}"),
        ("read", ", ".join(e.axes)),
        ("point", e.point),
        ("machine", e.machine),
    ]
    return titled(e.name, table(("", ""), facts), table(*experiment_rows(e)))


def experiment_rows(e: Experiment, count: int = 3) -> tuple[list[str], list[list[str]]]:
    """Header and the first rows of an experiment in mm, N and µm (mrad)."""
    read = [i for i, any_ in enumerate(e.axis_read) if any_]
    forces = [i for i in range(6) if e.wrench[:, i].any()]
    units = [f"{'fff'[i]}{'xyz'[i]}, N" if i < 3 else f"m{'xyz'[i - 3]}, N·m" for i in forces]
    head = ["id", "x, mm", "y, mm", "z, mm", *units]
    head += [f"{e.channels[i].name}, {'µm' if e.channels[i].unit == 'm' else 'mrad'}" for i in read]
    rows = []
    for n in range(min(count, len(e))):
        cells = [
            e.ids[n],
            *(f"{1e3 * v:.6g}" for v in e.position[n]),
            *(f"{e.wrench[n, i]:.6g}" for i in forces),
        ]
        cells += [f"{e.reading[n, i] * (1e6 if e.channels[i].unit == 'm' else 1e3):.5g}" for i in read]
        rows.append(cells)
    return head, rows


def residual_html(r: Residual) -> str:
    """Size of the residual per axis and its worst rows."""
    unit = {c.name: ("µm", 1e6) if c.unit == "m" else ("mrad", 1e3) for c in r.experiment.channels}
    rows = [(a, f"{v * unit[a][1]:.3g} {unit[a][0]}") for a, v in r.summary.per_axis.items()]
    worst = [(i, a, f"{v * unit[a][1]:.3g} {unit[a][0]}") for i, a, v in r.worst(20)]
    head = f"{r.experiment.name}: rms {1e6 * r.summary.rms:.3g} µm, chance under noise {r.lack_of_fit:.2g}"
    return titled(head, table(("axis", "rms"), rows), table(("worst row", "axis", "residual"), worst))


def diagnosis_html(d: Diagnosis) -> str:
    """The opening sentence, then the five lines."""
    from stiffmap.report.sentences import next_step, opening

    lines = "".join(f"<li>{escape(line)}</li>" for line in d.lines())
    return titled(opening(d), f"<p>{escape(next_step(d))}</p><ul>{lines}</ul>")


def link_html(link: Link) -> str:
    """The compliance with standard errors, N and mm."""
    from stiffmap.link.report import unit_factor, unit_name

    c, s, f = link.compliance, link.standard_error, unit_factor("mm")
    pairs = [(i, j) for i in range(6) for j in range(i, 6) if i == j or not link.insignificant[i, j]]
    rows: list[Any] = [
        (f"k{i + 1}{j + 1}", f"{c[i, j] * f[i, j]:.4g}", f"{s[i, j] * f[i, j]:.1g}", unit_name(i, j, "mm"))
        for i, j in pairs
    ]
    return titled("compliance of the link", table(("entry", "value", "±", "unit"), rows))

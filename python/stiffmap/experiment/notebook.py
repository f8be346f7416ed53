"""Experiments as a notebook shows them."""

from __future__ import annotations

from typing import Any

from stiffmap.common.short import table, titled


def experiment_html(e: Any) -> str:
    """What was measured, and three rows."""
    facts = [
        ("quantity", e.quantity),
        ("rows, poses", f"{len(e)}, {int(e.groups.max()) + 1}"),
        ("read", ", ".join(e.axes)),
        ("point", e.point),
        ("machine", e.machine),
    ]
    return titled(e.name, table(("", ""), facts), table(*experiment_rows(e)))


def experiment_rows(e: Any) -> tuple[list[str], list[list[str]]]:
    """Header and the first three rows of an experiment in mm, N and µm (mrad)."""
    read = [i for i, any_ in enumerate(e.axis_read) if any_]
    forces = [i for i in range(6) if e.wrench[:, i].any()]
    units = [f"{'fff'[i]}{'xyz'[i]}, N" if i < 3 else f"m{'xyz'[i - 3]}, N·m" for i in forces]
    head = ["id", "x, mm", "y, mm", "z, mm", *units]
    head += [f"{e.channels[i].name}, {'µm' if e.channels[i].unit == 'm' else 'mrad'}" for i in read]
    rows = []
    for n in range(min(3, len(e))):
        cells = [
            e.ids[n],
            *(f"{1e3 * v:.6g}" for v in e.position[n]),
            *(f"{e.wrench[n, i]:.6g}" for i in forces),
        ]
        cells += [f"{e.reading[n, i] * (1e6 if e.channels[i].unit == 'm' else 1e3):.5g}" for i in read]
        rows.append(cells)
    return head, rows

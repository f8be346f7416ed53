"""What is said next to the scene, as HTML: the macros of the template escape every text of a file or a person."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import length_text, length_unit, place_text
from stiffmap.solve.advice import RIGID
from stiffmap.solve.budget import DeflectionBudget
from stiffmap.solve.solution import Solution
from stiffmap.solve.status import Status
from stiffmap.ui.plot.loaded import budget_rows
from stiffmap.ui.plot.planes import levels
from stiffmap.ui.plot.scene import FORCE
from stiffmap.ui.plot.skeleton import Skeleton
from stiffmap.ui.plot.style import BLACK, BLUE, ORANGE, TOLERANCE, leg_colours
from stiffmap.ui.report.sheet import templates
from stiffmap.ui.view.moment import Moment, turns
from stiffmap.ui.view.plane import QUANTITIES, STATUS_COLOURS, PlaneMap, table, tolerance_level
from stiffmap.ui.view.scene import DARK, GHOST, GREY
from stiffmap.workspace.performance.motion.closing import drive_table

RED = "#B00020"
Row = tuple[str, float, str, str]
"""Label, length of the bar (-1 … 1), colour, text."""


@cache
def _macros() -> Any:
    return templates(Path(__file__).parent / "pages").get_template("panels.html").module


DUST = 1e-12  # m and m/N, below which a deflection and a compliance are round-off


def status_line(moment: Moment, solution: Solution, message: str, error: str) -> str:
    """Where the tool is, how far it moves, what is wrong; a live region for screen readers."""
    size = float(np.linalg.norm(solution.displacement[:3]))
    if bool(solution.ok) and max(size, np.abs(solution.compliance[:3, :3]).max()) < DUST:
        said = (RIGID, "", "")
    elif bool(solution.ok):
        unit, factor, decimals = length_unit(size)
        parts = ", ".join(f"{factor * v:z.{decimals}f}" for v in solution.displacement[:3])
        said = ("the tool moves ", length_text(size), f" ({parts}) {unit}")
    else:
        said = ("", Status(int(solution.status)).name.lower(), ": no equilibrium")
    where = f"{moment.machine.name} at {place_text(moment.state.position, '.1f')}"
    return str(_macros().status(where, said, message, error, ORANGE, RED))


def colour_bar(found: PlaneMap, limits: tuple[float, float], tolerance: float) -> str:
    """An SVG with the scale, its round values (those of the isolines) and the tolerance."""
    q = QUANTITIES[found.quantity]
    if found.quantity == "status":
        names = ((colour, kind.name.lower().replace("_", " ")) for kind, colour in STATUS_COLOURS.items())
        return str(_macros().status_colours(names))
    low, high = limits
    unit, factor = q.shown(max(map(abs, limits)))

    def at(v: float) -> str:
        return f"{10 + 280 * (v - low) / (high - low):.1f}"

    level = tolerance_level(found.quantity, tolerance)
    mark = at(level) if level is not None and low < level < high else ""
    ticks = [(at(v), f"{factor * v:.5g}") for v in levels(*limits)]
    said = f"{factor * low:.4g} to {factor * high:.4g} {unit}"
    stops, failed = table()[:: 255 // 15], int(found.failed.sum())
    return str(_macros().colour_bar(f"{q.title}, {unit}", said, stops, ticks, mark, TOLERANCE, failed))


def bars(title: str, rows: Sequence[Row]) -> str:
    """A table with a bar in each row."""
    return str(_macros().bars(title, rows))


def shares_panel(budget: DeflectionBudget, lit: str = "") -> str:
    """Where the deflection comes from."""
    found = budget_rows(budget)
    biggest = max((abs(s) for _, s, _ in found), default=1.0) or 1.0
    rows: list[Row] = [
        (f"▶ {n}" if n == lit else n, s / biggest, BLUE if s >= 0 else ORANGE, text) for n, s, text in found
    ]
    return bars(f"where the {length_text(float(np.linalg.norm(budget.displacement[:3])))} come from", rows)


def principal(compliance: Floats) -> tuple[Floats, Floats]:
    """Principal compliances (3,) m/N, the largest first, and their directions (3, 3) as rows."""
    values, vectors = np.linalg.eigh((compliance + compliance.T) / 2)
    return np.asarray(values[::-1]), np.asarray(vectors.T[::-1])


def compliance_panel(solution: Solution) -> str:
    """Principal compliances of the tool and their directions."""
    c = solution.compliance[:3, :3]
    if not np.isfinite(c).all():
        return bars("compliance of the tool: none, there is no equilibrium", [])
    values, directions = principal(c)
    largest = values[0] or 1.0
    rows: list[Row] = [
        (f"({', '.join(f'{x:z.2f}' for x in d)})", v / largest, BLUE, f"{1e6 * v:.4g} µm/N")
        for v, d in zip(values, directions, strict=True)
    ]
    return bars("principal directions of the tool's compliance", rows)


def efforts_panel(moment: Moment, solution: Solution) -> str:
    """What the drives hold, against what they can."""
    m = moment.machine
    names = m.compiled.names
    most = [np.nan if d.force is None else d.force for d in drive_table(m)]
    rows: list[Row] = []
    largest = float(np.nanmax(np.abs(solution.actuator_effort), initial=1e-300))
    for name, effort, limit in zip(m.actuators, solution.actuator_effort, most, strict=True):
        unit = "N" if names.is_prismatic(name) else "N·m"
        if np.isfinite(limit) and limit > 0:
            part = effort / limit
            rows.append((name, part, RED if abs(part) > 1 else BLUE, f"{effort:z.1f} of {limit:g} {unit}"))
        else:
            rows.append((name, effort / largest, BLUE, f"{effort:z.1f} {unit}, no limit declared"))
    return bars("efforts of the drives", rows)


def frequencies_panel(frequency: Sequence[float], shown: int) -> str:
    """The lowest modes."""
    finite = [f for f in frequency if np.isfinite(f)]
    top = max(finite, default=1.0)
    rows: list[Row] = [
        (f"▶ mode {i + 1}" if i == shown else f"mode {i + 1}", f / top, BLUE, f"{f:.4g} Hz")
        for i, f in enumerate(finite)
    ]
    return bars("natural frequencies, drives held", rows)


def probe_text(moment: Moment, point: Sequence[float]) -> str:
    """What the chosen quantity is at a point of the plane, solved there."""
    value, status = map(float, moment.at(np.array(point, dtype=float)))
    q = QUANTITIES[moment.state.quantity]
    unit, factor = q.shown(value * q.factor)
    lost = Status(int(status)).name.lower()
    said = f"{value * q.factor * factor:.5g} {unit}".strip() if np.isfinite(value) else lost
    return f"probe at {place_text(point, '.1f')}: {said}"


def legend(moment: Moment, rest: Skeleton, factor: float) -> str:
    """Rows of what is drawn of this machine; `factor`: the magnification of the deflected one."""
    state = moment.state
    size = float(np.linalg.norm(state.force))
    rows = [("line", c, f"leg {leg}") for leg, c in leg_colours(moment.machine.legs).items() if leg]
    rows += [("line", GREY, "travel of the drives")] if len(rest.guides) else []
    rows += [("square", BLACK, "drive")] if len(rest.actuators) else []
    rows += [("dot", "#FFFFFF", "passive joint")] if len(rest.passive) else []
    rows += [("square", DARK, "platform")] if len(rest.plate) else []
    rows += [("frame", "none", "workspace box")]
    rows += [("line", GHOST, f"under the load, × {factor:g}")] if factor else []
    rows += [("line", FORCE, f"force, {size:.4g} N")] if size else []
    if tolerance_level(state.quantity, state.tolerance) is not None:
        rows.append(("line", TOLERANCE, f"tolerance, {length_text(state.tolerance)}"))
    return str(_macros().legend(rows))


def hint(moment: Moment) -> str:
    """What can be dragged."""
    return str(_macros().hint(any(turns(moment.machine))))

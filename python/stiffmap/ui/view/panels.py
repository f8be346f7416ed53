"""What is said next to the scene, as HTML: every text of a file or a person is escaped here."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

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
from stiffmap.ui.view.moment import Moment, turns
from stiffmap.ui.view.plane import QUANTITIES, STATUS_COLOURS, PlaneMap, table, tolerance_level
from stiffmap.ui.view.scene import DARK, GHOST, GREY
from stiffmap.workspace.performance.motion.closing import drive_table

RED = "#B00020"
Row = tuple[str, float, str, str]
"""Label, length of the bar (-1 … 1), colour, text."""


DUST = 1e-12  # m and m/N, below which a deflection and a compliance are round-off


def status_line(moment: Moment, solution: Solution, message: str, error: str) -> str:
    """Where the tool is, how far it moves, what is wrong; a live region for screen readers."""
    size = float(np.linalg.norm(solution.displacement[:3]))
    if bool(solution.ok) and max(size, np.abs(solution.compliance[:3, :3]).max()) < DUST:
        said = RIGID
    elif bool(solution.ok):
        unit, factor, decimals = length_unit(size)
        parts = ", ".join(f"{factor * v:z.{decimals}f}" for v in solution.displacement[:3])
        said = f"the tool moves <b>{length_text(size)}</b> ({parts}) {unit}"
    else:
        said = f"<b>{escape(Status(int(solution.status)).name.lower())}</b>: no equilibrium"
    lines = [f"{escape(moment.machine.name)} at {place_text(moment.state.position, '.1f')}: {said}"]
    lines += [f'<span style="color:{ORANGE}">{escape(message)}</span>'] if message else []
    for line in error.splitlines():
        lines.append(f'<span role="alert" style="color:{RED}">{escape(line)}</span>')
    return f'<div role="status" aria-live="polite" style="padding:.3em .6em">{"<br/>".join(lines)}</div>'


def colour_bar(found: PlaneMap, limits: tuple[float, float], tolerance: float) -> str:
    """An SVG with the scale, its round values (those of the isolines) and the tolerance."""
    q = QUANTITIES[found.quantity]
    if found.quantity == "status":
        marks = "".join(
            f'<span style="background:rgb{c};display:inline-block;width:1em">&nbsp;</span> '
            f"{escape(k.name.lower().replace('_', ' '))} "
            for k, c in STATUS_COLOURS.items()
        )
        return f'<div style="padding:.3em .6em" aria-label="status of the poses">{marks}</div>'
    low, high = limits
    unit, factor = q.shown(max(map(abs, limits)))
    stops = "".join(
        f'<stop offset="{i / 15:.4f}" stop-color="rgb({r},{g},{b})"/>'
        for i, (r, g, b) in enumerate(table()[:: 255 // 15])
    )

    def at(v: float) -> float:
        return 10 + 280 * (v - low) / (high - low)

    ticks = "".join(
        f'<line x1="{at(v):.1f}" x2="{at(v):.1f}" y1="18" y2="36" stroke="white" stroke-width=".8"/>'
        f'<text x="{at(v):.1f}" y="48" font-size="10" text-anchor="middle" fill="currentColor">{factor * v:.5g}</text>'
        for v in levels(*limits)
    )
    level = tolerance_level(found.quantity, tolerance)
    if level is not None and low < level < high:
        ticks += f'<line x1="{at(level):.1f}" x2="{at(level):.1f}" y1="14" y2="40" stroke="{TOLERANCE}" stroke-width="2.5"/>'
    words = f"{q.title}, {unit}"
    failed = int(found.failed.sum())
    which = "1 pose" if failed == 1 else f"{failed} poses"
    note = f'<div style="font-size:85%">hatched: {which} without an equilibrium</div>' if failed else ""
    text = f"{factor * low:.4g} to {factor * high:.4g} {unit}"
    return (
        f'<svg viewBox="0 0 300 54" width="100%" role="img" aria-label="{escape(words)}: {escape(text)}">'
        f'<defs><linearGradient id="scale">{stops}</linearGradient></defs>'
        f'<text x="10" y="12" font-size="11" fill="currentColor">{escape(words)}</text>'
        f'<rect x="10" y="18" width="280" height="18" fill="url(#scale)"/>{ticks}</svg>{note}'
    )


def bars(title: str, rows: Sequence[Row]) -> str:
    """A table with a bar in each row."""
    out = "".join(
        f'<tr><td style="white-space:nowrap">{escape(label)}</td><td style="width:35%"><div style="'
        f'width:{100 * min(abs(size), 1.0):.1f}%;background:{colour};height:.8em"></div></td>'
        f'<td style="text-align:right;white-space:nowrap">{escape(text)}</td></tr>'
        for label, size, colour, text in rows
    )
    return (
        f'<table style="width:100%;font-size:85%;padding:0 .8em 0 .4em"><caption style="text-align:left"><b>{escape(title)}</b>'
        f"</caption>{out}</table>"
    )


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


DOT = "width:.7em;height:.7em;border-radius:50%;border:1px solid #888"
PADDED = "padding:.3em .6em;font-size:85%"
SQUARE, LINE = "width:.7em;height:.7em", "width:1.4em;height:.25em"


def legend(moment: Moment, rest: Skeleton, factor: float) -> str:
    """Rows of what is drawn of this machine; `factor`: the magnification of the deflected one."""
    state = moment.state
    size = float(np.linalg.norm(state.force))
    rows = [(LINE, c, f"leg {leg}") for leg, c in leg_colours(moment.machine.legs).items() if leg]
    rows += [(LINE, GREY, "travel of the drives")] if len(rest.guides) else []
    rows += [(SQUARE, BLACK, "drive")] if len(rest.actuators) else []
    rows += [(DOT, "#FFFFFF", "passive joint")] if len(rest.passive) else []
    rows += [(SQUARE, DARK, "platform")] if len(rest.plate) else []
    rows += [("width:.6em;height:.6em;border:1px solid #888", "none", "workspace box")]
    rows += [(LINE, GHOST, f"under the load, × {factor:g}")] if factor else []
    rows += [(LINE, FORCE, f"force, {size:.4g} N")] if size else []
    if tolerance_level(state.quantity, state.tolerance) is not None:
        rows.append((LINE, TOLERANCE, f"tolerance, {length_text(state.tolerance)}"))
    said = "".join(
        f'<span style="display:inline-block;margin-right:1em"><span style="display:inline-block;vertical-align:middle;{shape};'
        f'background:{colour}"></span> {escape(text)}</span> '
        for shape, colour, text in rows
    )
    return f'<div style="{PADDED}">{said}</div>'


def hint(moment: Moment) -> str:
    """What can be dragged."""
    turned = "; its rings turn it" if any(turns(moment.machine)) else ""
    return (
        f'<div style="{PADDED}"><b>Drag</b> the tool by its arrows and squares{turned}. Drag the force by the arrows at its tail. '
        "Click the plane to place the probe, and drag its red dot.</div>"
    )

"""A machine at a pose, and under load: its shape without it (grey), with it (enlarged), and where the deflection comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array, real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, length_unit, percents, place_text, vector_text
from stiffmap.solve.budget import DeflectionBudget, deflection_budget
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.ui.plot.scene import draw_box, draw_force, draw_skeleton, finish, on, scene_axes
from stiffmap.ui.plot.skeleton import Skeleton, skeleton, standing
from stiffmap.ui.plot.style import BLUE, ORANGE, headline, leg_colours, paper
from stiffmap.workspace.maps.inputs import place

SHOWN = 0.08  # of the machine's extent, how far the tool moves in the picture
MOST_BARS = 10
FAINT = 5e-4  # share of an element that is not worth a bar


@takes_machine
def machine_figure(
    machine: Machine,
    position: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    view: tuple[float, float] | None = None,
) -> Figure:
    """The machine at a commanded TCP pose (m, base axes; None: home), springs at rest.

    `view`: elevation and azimuth in deg; None: from above where everything lies in a plane of constant z,
    else (22, 35). Raises StiffmapError where the pose cannot be reached.
    """
    p = machine.description.home.p if position is None else place(position)
    shape = standing(machine, p, rotation)
    with paper(5.6, 5.2, most=4) as figure:
        ax = scene_axes(figure, shape, view)
        draw_skeleton(ax, shape, leg_colours(machine.legs))
        if machine.description.workspace is not None:
            draw_box(ax, *machine.workspace)
        finish(ax, view)
        ax.set_title(f"{machine.name} at {place_text(p)}", fontsize=10)
    return figure


@dataclass(frozen=True)
class LoadedShape:
    """The machine at rest and under load (m, N), with the factor that makes the difference visible."""

    rest: Skeleton
    loaded: Skeleton
    factor: float
    displacement: Floats
    force: Floats


def loaded_shape(
    machine: Machine,
    position: ArrayLike | None,
    wrench: ArrayLike,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> LoadedShape:
    """Shapes at a pose (m): without load and gravity, and under a wrench (N, N·m at the TCP) and gravity (m/s²,
    None: the machine file's).

    Raises StiffmapError where one of them is no stable equilibrium.
    """
    p = machine.description.home.p if position is None else place(position)
    load = real_array(wrench, "wrench")
    free = machine.solve(p, np.zeros(6), rotation=rotation, gravity=np.zeros(3))
    under = machine.solve(p, load, rotation=rotation, gravity=gravity)
    status = int(real_number(np.maximum(free.status, under.status), "wrench", "one wrench"))
    if status != Status.CONVERGED:
        raise StiffmapError(
            f"{machine.name} cannot be drawn under load at {place_text(p)}: {Status(status).name.lower()}"
        )
    rest, loaded = (skeleton(machine, s.coordinates) for s in (free, under))
    d = np.asarray(under.displacement - free.displacement)
    factor = round_factor(SHOWN * rest.extent, float(np.linalg.norm(d[:3])))
    return LoadedShape(rest, loaded, factor, d, load[:3])


def round_factor(wanted: float, size: float) -> float:
    """1, 2 or 5 times a power of ten, near wanted over size."""
    if size <= 0 or wanted <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted / size))
    return float(max(s for s in (1.0, 2.0, 5.0) if s * power <= wanted / size) * power)


@takes_machine
def loaded_figure(
    machine: Machine,
    position: ArrayLike | None = None,
    wrench: ArrayLike = (0.0, 0.0, -300.0, 0.0, 0.0, 0.0),
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    view: tuple[float, float] | None = None,
) -> Figure:
    """The machine deformed by a wrench (N, N·m) and gravity (m/s², None: the machine file's), and the share of each
    element in the tool's deflection."""
    shape = loaded_shape(machine, position, wrench, rotation=rotation, gravity=gravity)
    budget = deflection_budget(machine, position, wrench, rotation=rotation, gravity=gravity)
    with paper(10.4, 5.0) as figure:
        grid = figure.add_gridspec(1, 2, width_ratios=(1.3, 1.0))
        ax = scene_axes(figure, shape.rest, view, grid[0, 0])
        label: str | None = "without load"
        for _, ends in shape.rest.bars:
            ax.plot(*on(ax, ends), color="0.72", lw=1.4, ls="--", zorder=1, label=label)
            label = None
        moved = shape.rest.enlarged(shape.loaded, shape.factor)
        draw_skeleton(ax, moved, leg_colours(machine.legs))
        draw_force(ax, moved.tcp, shape.force, shape.rest.extent)
        finish(ax, view)
        draw_budget(figure.add_subplot(grid[0, 1]), budget)
        size = float(np.linalg.norm(shape.displacement[:3]))
        headline(figure, f"{machine.name} at {place_text(budget.position)} under {vector_text(budget.wrench[:3], 4)} N: "
                         f"the tool moves {length_text(size)} (drawn × {shape.factor:g})")  # fmt: skip
    return figure


def budget_rows(budget: DeflectionBudget) -> list[tuple[str, float, str]]:
    """Element, its share of the tool's deflection along that, and both in words, the largest first; what is not worth a
    row is one at the end."""
    rows = [(n, s) for n, _, s in budget.ranked()]
    shown = min(MOST_BARS, sum(abs(s) > FAINT for _, s in rows))
    if len(rows) > shown + 1:
        rows[shown:] = [(f"{len(rows) - shown} others", sum(s for _, s in rows[shown:]))]
    size = float(np.linalg.norm(budget.displacement[:3]))
    unit, factor, decimals = length_unit(size)
    whole = percents([s for _, s in rows])
    return [
        (n, s, f"{factor * size * s:z.{decimals}f} {unit}, {p} %")
        for (n, s), p in zip(rows, whole, strict=True)
    ]


def draw_budget(ax: Axes, budget: DeflectionBudget) -> None:
    """A bar per element, in the direction in which the tool moves."""
    rows = budget_rows(budget)
    at = np.arange(len(rows))
    size = float(np.linalg.norm(budget.displacement[:3]))
    unit, factor, _ = length_unit(size)
    values = [factor * size * s for _, s, _ in rows]
    ax.barh(at, values, color=[BLUE if v >= 0 else ORANGE for v in values])
    for i, (v, (_, _, text)) in enumerate(zip(values, rows, strict=True)):
        ax.text(max(v, 0), i, f" {text}", va="center", fontsize=7)
    ax.set_yticks(at, [n for n, _, _ in rows])
    ax.invert_yaxis()
    ax.set_xlim(min(0.0, 1.15 * min(values, default=0)), 1.45 * max(max(values, default=1), 1e-9))
    ax.axvline(0, color="0.3", lw=0.6)
    ax.set(xlabel=f"part of the tool's deflection, {unit}", title="where the deflection comes from")

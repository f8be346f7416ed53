"""Pictures of a residual: vectors in the workspace, and against what may drive it."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import fdtrc

from stiffmap.experiment.comparison.residual import Residual
from stiffmap.experiment.experiment import WRENCH, Experiment, Floats
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.ui.plot.style import AFTER, BEFORE, MM, UM, new_figure

NOISE = "#d9d9d9"
MOST_LABELS = 12
FLAT = 0.05  # share of the largest extent below which poses lie in a plane

Driver = tuple[str, Floats, list[str]]
"""Label, value of each row, and names of the values where they are classes."""


def figures(r: Residual) -> dict[str, Figure]:
    """All figures by the names of their files; those of columns that the experiment lacks are left out."""
    drawn = [i for i, any_ in enumerate(r.experiment.axis_read) if any_]
    groups = {
        "residual_pose": pose_drivers(r.experiment),
        "residual_force": force_drivers(r.experiment),
        "residual_history": history_drivers(r.experiment),
    }
    made = {name: against(r, drivers, drawn) for name, drivers in groups.items() if drivers}
    vector = np.isfinite(pose_means(r.experiment, r.values)[:, :3]).all(axis=1).any()
    return {"residual_vectors": vectors(r)} | made if vector else made


def vectors(r: Residual) -> Figure:
    """Mean residual vector of each pose in the views of the workspace, on one scale.

    Deflections: a row for the loads along x, y and z each, residuals turned with the sign of the force.
    """
    e = r.experiment
    means = [
        (name, pose_means(e, kept(r, r.values)[:, :3] * weight[:, None]), AFTER)
        for name, weight in vector_cases(e)
    ]
    figure, longest = arrow_figure(pose_means(e, e.position), means)
    figure.suptitle(f"{e.name}: mean residual of each pose; longest arrow {longest * UM:.1f} µm")
    return figure


def arrow_figure(at: Floats, cases: Sequence[tuple[str, Floats, str]]) -> tuple[Figure, float]:
    """Arrows at poses (n, 3) m in the views in which these spread, on one scale, and the length of the longest, m.

    cases: title, arrows (n, 3) m and colour of each row; of poses in one plane they stand side by side.
    """
    longest = max(1e-12, *(float(np.nanmax(np.linalg.norm(v, axis=1), initial=0.0)) for _, v, _ in cases))
    at = at * MM
    scale = 0.2 * max(float(np.ptp(at, axis=0).max()), 1.0) / longest
    shown = views(at)
    if len(shown) == 1:
        figure = new_figure(5.0 * len(cases), 5.0)
        grid = figure.subplots(1, len(cases), squeeze=False, sharex=True, sharey=True).T
    else:
        figure = new_figure(11.0, 3.7 * len(cases) + 0.3)
        grid = figure.subplots(len(cases), len(shown), squeeze=False, sharex="col", sharey="col")
    for row, (name, arrows, colour) in zip(grid, cases, strict=True):
        for ax, view in zip(row, shown, strict=True):
            _arrows(ax, at, np.nan_to_num(arrows) * scale, view, colour)
        row[len(row) // 2].set_title(name)
    return figure, longest


def vector_cases(e: Experiment) -> list[tuple[str, Floats]]:
    """Name and (n,) weight of the rows, +1 or -1, NaN where a row does not count."""
    force = e.wrench[:, :3]
    if e.quantity == "position" or not force.any():
        return [("", np.ones(len(e)))]
    main = np.argmax(np.abs(force), axis=1)
    out = []
    for a in range(3):
        value = np.where(main == a, force[:, a], 0.0)
        if value.any():
            weight = np.where(value != 0, np.sign(value), np.nan)
            out.append((f"loads mainly along {'xyz'[a]}, signs turned to +{'xyz'[a]}", weight))
    return out


def views(at: Floats) -> tuple[tuple[int, int], ...]:
    """Planes in which poses (n, 3) spread; of poses in a plane that plane, of those on a line or at a point the first two."""
    extent = np.ptp(at, axis=0)
    flat = {a for a in range(3) if extent[a] <= FLAT * max(float(extent.max()), 1.0)}
    all_ = ((0, 1), (0, 2), (1, 2))
    if len(flat) == 1:
        return tuple(v for v in all_ if not flat & set(v))
    return tuple(v for v in all_ if not flat >= set(v)) or all_[:1]


def _arrows(ax: Axes, at: Floats, arrow: Floats, view: tuple[int, int], colour: str) -> None:
    a, b = view
    ax.quiver(
        *(at[:, a], at[:, b], arrow[:, a], arrow[:, b]),
        angles="xy", scale_units="xy", scale=1, color=colour, width=0.006,
    )  # fmt: skip
    ax.plot(at[:, a], at[:, b], ".", ms=3, color="0.4")
    ax.update_datalim((at + arrow)[:, [a, b]])  # autoscaling sees the tails of arrows only
    ax.margins(0.1)
    ax.tick_params(labelbottom=True, labelleft=True)  # also where axes are shared
    ax.set(xlabel=f"{'xyz'[a]}, mm", ylabel=f"{'xyz'[b]}, mm", aspect="equal")


def against(r: Residual, drivers: list[Driver], channels: list[int]) -> Figure:
    """Residual of each channel against each driver; the band is two noise floors wide to each side."""
    figure = new_figure(2.5 * len(drivers) + 1.0, 1.7 * len(channels) + 0.9)
    grid = figure.subplots(len(channels), len(drivers), squeeze=False, sharex="col", sharey="row")
    for row, channel in enumerate(channels):
        for column, driver in enumerate(drivers):
            _scatter(grid[row][column], r, channel, driver)
        grid[row][0].set_ylabel(_label(r.experiment, channel))
    for column, (name, _, _) in enumerate(drivers):
        grid[-1][column].set_xlabel(name)
    aside = "; crosses: outliers" if r.set_aside.any() else ""
    told = "reading minus prediction\ngrey: two standard deviations of the noise"
    figure.suptitle(f"{r.experiment.name}: {told}{aside}", fontsize=9)
    return figure


def _scatter(ax: Axes, r: Residual, channel: int, driver: Driver) -> None:
    _, x, labels = driver
    values, band = UM * r.values[:, channel], 2 * UM * float(r.noise.floor[channel])  # µm or µrad
    ax.axhspan(-band, band, color=NOISE, lw=0)
    ax.axhline(0, color="0.5", lw=0.6)
    spread = 0.12 * np.sin(np.arange(len(x)) * 2.4) if labels else 0.0
    ax.plot((x + spread)[~r.set_aside], values[~r.set_aside], ".", ms=3, color=AFTER, alpha=0.6)
    ax.plot((x + spread)[r.set_aside], values[r.set_aside], "x", ms=5, color=BEFORE)
    if labels:
        ax.set_xticks(range(len(labels)), labels, fontsize=7, rotation=30 if len(labels) > 3 else 0)
        ax.set_xlim(-0.5, len(labels) - 0.5)


def _label(e: Experiment, channel: int) -> str:
    c = e.channels[channel]
    return f"{c.name}, {'µm' if c.unit == 'm' else 'µrad'}"


def pose_drivers(e: Experiment) -> list[Driver]:
    """Commanded coordinates; actuator coordinates where they are commanded."""
    out: list[Driver] = [(f"{c}, mm", e.position[:, i] * MM, []) for i, c in enumerate("xyz")]
    if e.other is not None:
        out.append(("distance, mm", np.linalg.norm(e.other - e.position, axis=1) * MM, []))
    for i, c in enumerate(e.command_of):
        assert e.command is not None
        unit, scale = ("mm", MM) if c.unit == "m" else ("deg", 180 / np.pi)
        out.append((f"{c.joint}, {unit}", e.command[:, i] * scale, []))
    return out


def force_drivers(e: Experiment) -> list[Driver]:
    """Components and size of the force, its direction, and moments."""
    if not e.wrench.any():
        return []
    force, units = e.wrench[:, :3], ("N", "N·m")
    acting = [i for i in range(6) if e.wrench[:, i].any()]
    out: list[Driver] = [(f"{WRENCH[i]}, {units[i // 3]}", e.wrench[:, i], []) for i in acting]
    if not force.any():
        return out
    out.append(("size of the force, N", np.linalg.norm(force, axis=1), []))
    return out + _directions(force)


def _directions(force: Floats) -> list[Driver]:
    top = np.abs(force).max(axis=1, keepdims=True)
    ratio = np.round(force / np.where(top > 0, top, 1.0), 2) + 0.0
    kinds, at = np.unique(ratio, axis=0, return_inverse=True)
    if len(kinds) > MOST_LABELS:
        turn = np.degrees(np.arctan2(force[:, 1], force[:, 0]))
        return [("direction in the xy plane, deg", turn, [])]
    return [("direction of the force", at.reshape(-1).astype(float), [direction_name(k) for k in kinds])]


def direction_name(ratio: Floats) -> str:
    """``x``, ``-x+0.5y``, ``none``, from components over the largest."""
    parts = [f"{v:+g}{a}" for v, a in zip(ratio, "xyz", strict=True) if v]
    text = re.sub(r"([+-])1([xyz])", r"\1\2", "".join(parts))
    return text.removeprefix("+") or "none"


def history_drivers(e: Experiment) -> list[Driver]:
    """Order, temperature, branch, set-up."""
    series = (("order", e.order), ("temperature", e.temperature))
    out: list[Driver] = [(n, x, []) for n, x in series if x is not None]
    for name, words in (("branch", e.branch), ("set-up", e.setup)):
        if words:
            labels, at = np.unique(words, return_inverse=True)
            out.append((name, at.reshape(-1).astype(float), [str(w) or "none" for w in labels]))
    return out


TREND = 1e-3  # p-value below which residuals follow a driver, over all drivers and channels


def trending(d: Diagnosis) -> tuple[list[Driver], list[Driver]]:
    """Drivers that residuals follow, before or after, and the others."""
    drivers = drivers_of(d.experiment)
    read = np.flatnonzero(d.experiment.axis_read)
    level = TREND / max(2 * len(drivers) * len(read), 1)
    left = [kept(d, r)[:, i] for r in (d.residual_before, d.residual_after) for i in read]
    followed = [any(_follows(x, values) < level for values in left) for _, x, _ in drivers]
    both = list(zip(drivers, followed, strict=True))
    return [v for v, f in both if f], [v for v, f in both if not f]


def _follows(x: Floats, y: Floats) -> float:
    """p-value of a parabola through residuals over a driver."""
    good = np.isfinite(x) & np.isfinite(y)
    columns = min(3, len(np.unique(x[good])))
    n = int(good.sum())
    if columns < 2 or n < columns + 3:
        return 1.0
    u = (x[good] - x[good].mean()) / np.ptp(x[good])
    a = np.vander(u, columns)
    left = y[good] - a @ np.linalg.lstsq(a, y[good], rcond=None)[0]
    rest, whole = float(left @ left), float(np.sum((y[good] - y[good].mean()) ** 2))
    if rest <= 0:
        return 1.0 if whole <= 0 else 0.0
    ratio = (max(whole - rest, 0.0) / (columns - 1)) / (rest / (n - columns))
    return float(fdtrc(columns - 1, n - columns, ratio))


def trends(d: Diagnosis, drivers: list[Driver]) -> Figure:
    """Residual of each channel against what may drive it."""
    axes_read = [int(i) for i in np.flatnonzero(d.experiment.axis_read)]
    # a row per driver fits an upright page; its columns are the channels
    figure = new_figure(max(6.0, 3.0 * len(axes_read)), 1.9 * len(drivers) + 0.6)
    grid = figure.subplots(len(drivers), len(axes_read), squeeze=False, sharex="row", sharey="col")
    both = ((d.residual_before, BEFORE, "before"), (d.residual_after, AFTER, "after"))
    for row, (name, x, _) in enumerate(drivers):
        for column, axis in enumerate(axes_read):
            ax = grid[row][column]
            for values, colour, label in both:
                ax.plot(x, kept(d, values)[:, axis] * UM, ".", ms=3, color=colour, alpha=0.6, label=label)
            ax.axhline(0, color="0.5", lw=0.6)
            ax.set_xlabel(name, fontsize=9)
            ax.tick_params(labelsize=8)
            ax.set_ylabel(_label(d.experiment, axis), fontsize=9)
    grid[0][0].legend(fontsize=8)
    figure.suptitle("Residual: reading minus prediction")
    return figure


def drivers_of(e: Experiment) -> list[Driver]:
    """What residuals of a diagnosis are drawn against, whole numbers for the branch."""
    forces = [f for f in force_drivers(e) if f[0] in ("fx, N", "fy, N", "fz, N")]
    out = [*pose_drivers(e)[:3], *forces, *(s for s in history_drivers(e) if not s[2])]
    if e.branch:
        unloading = np.array([b == "unloading" for b in e.branch], float)
        out.append(("branch: 0 loading, 1 unloading", unloading, []))
    return out


def kept(found: Residual | Diagnosis, values: Floats) -> Floats:
    """(n, k) values, NaN in rows that were set aside."""
    return np.where(found.set_aside[:, None], np.nan, values)


def pose_means(e: Experiment, values: Floats) -> Floats:
    """(groups, k) mean of what is finite of each pose."""
    finite = pd.DataFrame(np.where(np.isfinite(values), values, np.nan))
    return np.asarray(finite.groupby(e.groups).mean())

"""Pictures of the measures: Figure 1 of the paper, maps, the table against its requirements, lines along a toolpath."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import product
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.box import box_figure, workspace_figure
from stiffmap.ui.plot.modes import mode_figure, mode_frames
from stiffmap.ui.plot.style import BLACK, BLUE, COLOURS, MM, SKY, VERMILLION, headline, line_look, paper
from stiffmap.workspace.performance.box.box import LargestBox
from stiffmap.workspace.performance.box.workspace import Workspace
from stiffmap.workspace.performance.motion.trajectory import way_along
from stiffmap.workspace.performance.requirements import Bound
from stiffmap.workspace.performance.table import MeasureRow, MeasuresTable, box_map, levels


def transmission_figure(machine: Machine, position: ArrayLike, plane: str = "xy") -> Figure:
    """Figure 1a-c of the paper at one pose: images of the sphere and the cube of drive rates, hexagon."""
    from stiffmap.workspace.performance.motion.velocity import velocity_section, velocity_transmission

    p = np.asarray(position, dtype=float)
    v = velocity_transmission(machine, p)
    j = v.jacobian[:3]
    if not np.isfinite(j).all():
        raise StiffmapError(f"{machine.name}: no Jacobian at {p.tolist()} m (status {int(v.status)})")
    with paper(11.0, 4.2, most=0) as figure:
        axes: list[Any] = [figure.add_subplot(1, 3, i, projection="3d" if i < 3 else None) for i in (1, 2, 3)]
        _ellipsoid(axes[0], j)
        axes[0].set_title(f"(a) sphere: {v.sphere_min:.3g} … {v.sphere_max:.3g}", y=0.95)
        _parallelepiped(axes[1], j)
        axes[1].set_title(f"(b) cube: {v.cube_min:.3g} … {v.cube_max:.3g}", y=0.95)
        for a in axes[:2]:
            a.set(xlabel="$v_x$", ylabel="$v_y$")
            a.set_zlabel("$v_z$", labelpad=-1)
            a.tick_params(labelsize=7, pad=0)
            a.set_box_aspect(None, zoom=0.9)  # the layout does not know labels in space
        h = velocity_section(machine, p, plane=plane)
        _hexagon(axes[2], h.vertices, float(h.inner), float(h.outer))
        axes[2].set_title(f"(c) {plane} plane: {float(h.inner):.3g} … {float(h.outer):.3g}")
        axes[2].set(xlabel=f"$v_{plane[0]}$ per drive speed", ylabel=f"$v_{plane[1]}$ per drive speed")
        headline(figure, f"{machine.name} at {place_text(p, '.0f')}: velocity transmission")
    return figure


def _ellipsoid(axes: Axes3D, j: Floats) -> None:
    u, s, _ = np.linalg.svd(j, full_matrices=False)
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(0, np.pi, 25))
    ball = np.stack([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)])[: len(s)]
    x, y, z = np.einsum("ik,kab->iab", u * s, ball)
    axes.plot_surface(x, y, z, color=SKY, alpha=0.35, linewidth=0)
    axes.plot_wireframe(x, y, z, rstride=6, cstride=6, color=BLUE, linewidth=0.4)


def _parallelepiped(axes: Axes3D, j: Floats) -> None:
    n = j.shape[1]
    if n > 6:
        return
    corners = {c: j @ np.array(c) for c in product((-1.0, 1.0), repeat=n)}
    for c, p in corners.items():
        for i in range(n):
            if c[i] < 0:
                q = corners[(*c[:i], 1.0, *c[i + 1 :])]
                axes.plot(*np.stack([p, q]).T, color=BLUE, linewidth=1.0 if n == 3 else 0.3)


def _hexagon(axes: Axes, vertices: Floats, inner: float, outer: float) -> None:
    turn = np.linspace(0, 2 * np.pi, 181)
    closed = np.concatenate([vertices, vertices[:1]])
    axes.fill(*closed.T, color=SKY, alpha=0.35)
    axes.plot(*closed.T, color=BLUE)
    axes.plot(inner * np.cos(turn), inner * np.sin(turn), "--", color=VERMILLION, label="every direction")
    axes.plot(outer * np.cos(turn), outer * np.sin(turn), ":", color=VERMILLION, label="best direction")
    axes.set_aspect("equal")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False)


def measure_figures(table: MeasuresTable) -> dict[str, Figure]:
    """Name -> figure: the table against its requirements, a map on three planes of each measure that has one, Figure 1 and modes at the worst poses."""
    out = {"requirements": requirement_figure(table)} if table.requirements.bounds else {}
    for row in table.rows:
        if row.measure.name not in ALONG and box_map(row) is not None:
            out[f"map-{row.measure.name}"] = map_figure(table, row)
    rows = {r.measure.name: r for r in table.rows}
    space = rows.get("workspace")
    if space is not None and space.found.worst > 0:
        found = cast(Workspace, space.found.extra["workspace"])
        out["map-workspace"] = workspace_figure(table.machine, found)
    box = rows.get("largest_box")
    if box is not None and box.found.worst > 0:
        with suppress(StiffmapError):  # a line
            out["largest-box"] = box_figure(table.machine, cast(LargestBox, box.found.extra["box"]))
    if path_rows(table):
        out["toolpath"] = path_measures_figure({table.machine.name: table})
    last = rows.get("transmission_max")
    if last is not None and last.found.worst_at is not None and np.isfinite(last.found.worst):
        out["transmission"] = transmission_figure(table.machine, last.found.worst_at, table.case.plane)
    slow = _slowest(table)
    if slow is not None:
        out["modes"] = mode_figure(table.machine, slow, gravity=table.case.gravity)
    return out


def moving_modes(table: MeasuresTable) -> Iterator[Figure]:
    """Frames of the modes at the pose of the lowest frequency, where there is one."""
    slow = _slowest(table)
    if slow is not None:
        yield from mode_frames(table.machine, slow, gravity=table.case.gravity)


def _slowest(table: MeasuresTable) -> Floats | None:
    rows = [r for r in table.rows if r.measure.name == "frequency" and np.isfinite(r.found.worst)]
    return rows[0].found.worst_at if rows else None


ALONG = ("path_compliance", "path_effort")


def path_rows(table: MeasuresTable) -> dict[str, MeasureRow]:
    """Measures along the path that have values there, by their names."""
    return {r.measure.name: r for r in table.rows if r.measure.name in ALONG and r.found.values is not None}


def path_measures_figure(tables: Mapping[str, MeasuresTable]) -> Figure:
    """A panel per measure over the way along the path: of one machine its drives, of several machines a line each.

    Raises StiffmapError where nothing was measured along a path.
    """
    names = [n for n in ALONG if any(n in path_rows(t) for t in tables.values())]
    if not names:
        raise StiffmapError("no measure along a toolpath; asked for path_compliance, path_effort")
    one = len(tables) == 1
    with paper(6.4, 0.9 + 2.2 * len(names)) as figure:
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            for i, (machine, table) in enumerate(tables.items()):
                if (row := path_rows(table).get(name)) is not None:
                    _lines(axes, row, machine, i, one)
            axes.set_ylim(bottom=0)
        panels[-1].set_xlabel("way along the path, mm")
        told = f"{next(iter(tables))}: along" if one else "Along"
        headline(figure, f"{told} the toolpath, with its force")
    return figure


def _lines(axes: Axes, row: MeasureRow, machine: str, number: int, one: bool) -> None:
    positions, values = row.found.positions, row.found.values
    assert positions is not None
    assert values is not None
    way = MM * way_along(positions)
    share = row.found.extra.get("share")
    if one and isinstance(share, np.ndarray):
        for j, drive in enumerate(row.found.extra["drives"]):  # type: ignore[arg-type, var-annotated]
            axes.plot(way, share[:, j], label=str(drive), **line_look(j))
    else:
        look = line_look(number) | ({"color": BLACK, "label": ""} if one else {"label": machine})
        axes.plot(way, row.measure.factor * values, **look)
    unit = "share of the declared effort" if share is not None else f"compliance, {row.measure.shown}"
    axes.set_ylabel(unit)
    limit = None if row.bound is None else row.bound.at_most
    if limit is not None and number == 0:
        axes.axhline(row.measure.factor * limit, color="0.4", linewidth=0.8, label="required: below")


CAPTIONS = {
    "requirements": "Each requirement: the worst value over its bound. The line at 1 is the bound.",
    "transmission": "Velocities of the tool at the worst pose for drive rates within a sphere (a), within a cube (b), and in the "
    "plane (c).",
    "map-workspace": "Sections of the workspace through its middle, and what it ends by.",
    "largest-box": "The largest box in sections through its corner that comes nearest to a limit, and what ends the workspace "
    "about it.",
    "toolpath": "Along the toolpath: compliance in the direction of its force, shares of the drives' declared efforts.",
    "modes": "Natural modes at the pose of the lowest frequency, swinging.",
}


def caption(name: str) -> str:
    """What a figure of `measure_figures` shows, in a sentence."""
    mapped = name.removeprefix("map-").replace("_", " ")
    return CAPTIONS.get(name) or f"Map of {mapped} over the box: lowest, middle and highest plane."


def requirement_figure(table: MeasuresTable) -> Figure:
    """Each requirement as a bar: worst value over the bound, the line at 1 is the bound."""
    bounds = [(r, r.bound) for r in table.rows if r.bound is not None]
    rows = [r for r, _ in bounds]
    with paper(6.4, 0.6 + 0.42 * len(rows), most=0) as figure:
        axes = figure.add_subplot()
        shares = np.nan_to_num([_share(r) for r in rows], posinf=0.0, neginf=0.0)
        colours = [BLUE if r.verdict == "pass" else VERMILLION for r in rows]
        axes.barh(range(len(rows)), shares, color=colours, height=0.6)
        for i, (r, share) in enumerate(zip(rows, shares, strict=True)):
            text = f"{r.measure.factor * r.found.worst:.4g} {r.measure.shown} – {r.verdict}"
            axes.text(max(share, 1.0) * 1.02, i, text, va="center")
        axes.axvline(1.0, color="black", linewidth=1)
        names = [f"{r.measure.name} {b.text(r.measure.factor)} {r.measure.shown}".rstrip() for r, b in bounds]
        axes.set_yticks(range(len(rows)), names)
        axes.invert_yaxis()
        axes.set_xlim(0, 1.45 * max([1.0, *shares]))
        axes.set_xlabel("worst value over the bound (line: the bound)")
        axes.set_title(f"{table.machine.name} against {table.requirements.name}")
    return figure


def _limit(bound: Bound | None) -> float | None:
    """The one number of a requirement that is drawn."""
    return None if bound is None else bound.at_least if bound.at_least is not None else bound.at_most


def _share(r: MeasureRow) -> float:
    limit = _limit(r.bound)
    return float(r.found.worst / limit) if limit else float("nan")


def map_figure(table: MeasuresTable, row: MeasureRow) -> Figure:
    """A measure on the lowest, middle and highest z-plane of the box."""
    over = box_map(row)
    assert over is not None
    x, y, z, grid = over
    planes = sorted({0, len(z) // 2, len(z) - 1})
    with paper(3.0 * len(planes) + 0.8, 3.2, most=0) as figure:
        axes = figure.subplots(1, len(planes), squeeze=False)[0]
        steps = levels(grid)
        for a, k in zip(axes, planes, strict=True):
            _plane(a, row, x, y, grid[:, :, k], steps)
            a.set_title(f"z = {MM * z[k]:.0f} mm")
        drawn = next((a.collections[0] for a in axes if a.collections), None)
        if drawn is not None:
            figure.colorbar(drawn, ax=list(axes), label=row.measure.shown or row.measure.name)
        figure.suptitle(
            f"{table.machine.name}: {row.measure.title}"
            + (f" {row.found.note}" if "under" in row.found.note else "")
        )
    return figure


def _plane(axes: Axes, row: MeasureRow, x: Floats, y: Floats, values: Floats, steps: Floats) -> None:
    measure, limit = row.measure, _limit(row.bound)
    if not np.isfinite(values).any():
        axes.text(0.5, 0.5, "no value in this plane", transform=axes.transAxes, ha="center", va="center")
    elif len(x) > 1 and len(y) > 1:
        axes.contourf(MM * x, MM * y, values.T, levels=steps, cmap=COLOURS, extend="both")
        if limit is not None and np.nanmin(values) < measure.factor * limit < np.nanmax(values):
            axes.contour(MM * x, MM * y, values.T, levels=[measure.factor * limit], colors=[VERMILLION])
            told = f"required: {measure.factor * limit:.4g} {measure.shown}".rstrip()
            axes.plot([], [], color=VERMILLION, label=told)
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.24), frameon=False, fontsize="small")
    else:
        line = values.ravel()
        axes.scatter(
            *np.meshgrid(MM * x, MM * y, indexing="ij"), c=line, cmap=COLOURS, vmin=steps[0], vmax=steps[-1]
        )
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")

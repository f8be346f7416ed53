"""``stiffmap map --toolpath``: deflection along a path of the tool."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import length_text, place_text
from stiffmap.common.outputs import write_rows
from stiffmap.solve.kinematics import must_take
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import MM, finish, force_given
from stiffmap.ui.cli.output import show, write_files
from stiffmap.ui.plot.style import BLACK, CYCLE, length_unit, paper
from stiffmap.workspace.performance import load_motion
from stiffmap.workspace.performance.motion.trajectory import way_along


def map_toolpath(
    m: Machine,
    toolpath: str,
    force: str,
    how: dict[str, Any],
    output: Path,
    pictures: list[str],
    as_json: bool,
) -> None:
    """Solve along the path, print the worst place, write table, data and pictures."""
    position, given = load_motion(toolpath).places()
    must_take(m, position)
    load = given if given.any() else _load(m, position, force, how)
    wrench = np.hstack([load, np.zeros_like(load)])
    s = m.solve(position, wrench, **how)
    way = way_along(position)
    ds = s.to_xarray(("way",), {"way": ("way", way, {"units": "m"})})
    ds = ds.assign(position=(("way", "axis"), position), force=(("way", "axis"), load))
    pictured = toolpath_figure(ds, m.name) if pictures else None
    files = [*write_files(output, [("toolpath.nc", ds)]), _table(ds, output / "toolpath.csv")]
    files += write_files(output, ((f"toolpath.{kind}", pictured) for kind in pictures))
    failed = int((~s.ok).sum())
    sizes = ds.deflection.values
    worst, told = None, f"{m.name}: no pose of the path converged"
    if np.isfinite(sizes).any():
        i = int(np.nanargmax(sizes))
        worst = {"way": way[i], "position": position[i], "deflection": sizes[i]}
        told = (
            f"{m.name}: largest deflection along the path {length_text(sizes[i])} at {place_text(position[i], '.4g')}, "
            f"{way[i] / MM:.4g} mm from its start"
        )
    lost = f"{failed} of {len(way)} poses failed: {s.count()}" if failed else None
    data = {"machine": m.name, "poses": len(way), "failed": failed, "worst": worst}
    show(as_json, data, [told, lost], files)
    finish(failed > 0)


def _load(m: Machine, position: Floats, force: str, how: dict[str, Any]) -> Floats:
    """(n, 3) N: the vector given; of a size, in the direction that pushes the tool furthest at each pose."""
    size, vector = force_given(force)
    if vector is not None:
        return np.broadcast_to(vector, position.shape)
    c = m.solve(position, None, **how).compliance[:, :3, :3]
    right = np.linalg.svd(np.nan_to_num(c))[2]
    return np.asarray(size * right[:, 0])


def _table(ds: xr.Dataset, path: Path) -> Path:
    head = ["way [mm]", "x [mm]", "y [mm]", "z [mm]", "fx [N]", "fy [N]", "fz [N]",
            "dx [mm]", "dy [mm]", "dz [mm]", "deflection [mm]"]  # fmt: skip
    columns = np.column_stack([
        ds.way.values / MM, ds.position.values / MM, ds.force.values,
        ds.displacement.values[:, :3] / MM, ds.deflection.values / MM,
    ])  # fmt: skip
    write_rows(path, head, (list(map(repr, row)) for row in columns.tolist()))
    return path


def toolpath_figure(ds: xr.Dataset, name: str) -> Figure:
    """Deflection and its components over the way."""
    with paper(6.4, 3.4, f"{name}: deflection along the toolpath") as figure:
        ax: Any = figure.subplots()
        way = ds.way.values / MM
        unit, factor = length_unit(float(np.nanmax(ds.deflection.values, initial=0.0)))
        ax.plot(way, factor * ds.deflection.values, color=BLACK, lw=1.6, label="|d|")
        for i, axis in enumerate("xyz"):
            if np.nanmax(np.abs(ds.displacement.values[:, i]), initial=0.0) > 1e-12:
                ax.plot(way, factor * ds.displacement.values[:, i], color=CYCLE[i], lw=1.0, label=f"d{axis}")
        ax.set(xlabel="way along the path, mm", ylabel=f"deflection, {unit}")
        ax.grid(color="0.9", lw=0.5)
    return figure

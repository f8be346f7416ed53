from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer
import xarray as xr
from rich.table import Table

import stiffmap
from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, place_text
from stiffmap.common.outputs import make_folder
from stiffmap.solve.kinematics import must_take
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, force_given, gravity, machine_with, refuse_unused
from stiffmap.ui.cli.map_summary import MapSummary, assumptions, label, write_map_files
from stiffmap.ui.cli.options import PLANE, flag, how_many, option, written
from stiffmap.ui.cli.output import Answer, failed_in_words, table, write_files
from stiffmap.workspace.maps.inputs import magnitude, plane_axes
from stiffmap.workspace.maps.statistics import statistics_rows

STORED = "zarr resume tables own_scales compliance uncertainty"
"""Options of what a stored map holds, and of its files."""
UNUSED = {"with toolpath": f"x y z points plane tolerance directions estimate statistics scheduler {STORED}",
          "with statistics": f"x y output formats {STORED}", "without pictures": "formats own_scales"}  # fmt: skip


def command(
    context: typer.Context,
    machine: options.Machine,
    output: Path = written("Folder for the map and its pictures.", Path("stiffmap-map")),
    z: list[float] | None = option(
        "z-plane in mm; repeatable. [default: lowest, 0, highest of the workspace]"
    ),
    y: list[float] | None = option("Planes across y instead, in mm; repeatable."),
    x: list[float] | None = option("Planes across x instead, in mm; repeatable."),
    points: int = how_many(
        "Positions along each axis of a plane, over the whole workspace.", 101, most=PLANE
    ),
    force: options.Force = "300",
    toolpath: str | None = option(
        "Along a path of the tool instead of over planes: CSV or YAML, as for `efforts`; or a shipped one: trim."
    ),
    plane: options.Plane = "xy",
    tolerance: options.Tolerance = 0.25,
    directions: int = how_many(
        "Force directions solved before the extremes are searched; 16 or more for machines with play.",
        4,
        most=PLANE,
    ),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    compliance: bool = option("Keep the 6x6 compliance of every pose.", False),
    uncertainty: bool = flag(
        "Standard deviation of the map, from links and `u` of the file.", "--uncertainty"
    ),
    zarr: bool = flag("Write Zarr instead of NetCDF.", "--zarr"),
    resume: bool = flag("Take up an interrupted run.", "--resume"),
    pictures: bool = option("Draw the maps, and write them as a report (HTML).", True),
    formats: str = option(
        "Formats of the pictures: png, svg, pdf, or several as png,pdf.", "png", "--format"
    ),
    tables: str | None = option("Write the map as a table too: csv, xlsx, or csv,xlsx.", None, "--table"),
    own_scales: bool = flag("A colour scale for each plane instead of a common one.", "--own-scales"),
    estimate: bool = flag("Only say how long it will take, and the memory and disk it needs.", "--estimate"),
    statistics: bool = flag("Maxima, percentiles and shares only; no map is stored.", "--statistics"),
    scheduler: options.Scheduler = None,
    method: options.Method = "fast",
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> Answer:
    """Error maps of z-planes: how far a force in the plane pushes the tool off its commanded position.

    The default is the paper's Figure 7: 300 N, z = -200, 0 and 300 mm over the whole xy workspace,
    deflection in the plane. The paper does not say where its force points: mapped are the worst
    direction at every position, the best one, Fx and Fy. A force that is given as a vector is mapped
    next to the worst and the best direction of its size.

    Coordinates that a machine's task does not command are left at home: a planar machine has one plane.

    Exit codes: 0 done, 1 some poses failed (they hold NaN and their status), 2 bad input.

    Examples:
      [cyan]stiffmap map orthoglide-revised -o results[/cyan]
      [cyan]stiffmap map orthoglide-revised --force 200,0,-100 --points 41 -o results[/cyan]
      [cyan]stiffmap map my_machine.yaml --uncertainty --points 21[/cyan]
      [cyan]stiffmap map tripteron --force 100 --points 41 --z 300 --z 500[/cyan]
      [cyan]stiffmap map orthoglide-revised --y 0 --plane xz --points 41 --format svg[/cyan]
      [cyan]stiffmap map orthoglide-revised --gravity 0,0,-9.81 --tolerance 0.1 --json[/cyan]
      [cyan]stiffmap map orthoglide-revised --points 21 --table csv,xlsx -o results[/cyan]
      [cyan]stiffmap map orthoglide-revised --points 2001 --estimate[/cyan]
      [cyan]stiffmap map orthoglide-revised --points 51 --statistics[/cyan]
      [cyan]stiffmap map orthoglide-revised --toolpath trim -o results[/cyan]
    """
    refuse_unused(context, UNUSED)
    kinds = named_formats(formats, "--format", ("png", "svg", "pdf")) if pictures else []
    sheets = named_formats(tables, "--table", ("csv", "xlsx")) if tables else []
    m = machine_with(machine, effect)
    how: dict[str, Any] = {"gravity": gravity(gravity_), "method": method, "threads": threads}
    if toolpath is not None:
        return map_toolpath(m, toolpath, force, how, output, kinds)
    call: dict[str, Any] = {
        **planes({"x": x, "y": y, "z": z}), **how, "points": points, "wrench": cases(plane, force), "plane": plane,
        "directions": directions, "tolerance": MM * tolerance, "compliance": compliance, "uncertainty": uncertainty,
    }  # fmt: skip
    if estimate:
        found = stiffmap.map_estimate(m, **call)
        return Answer(vars(found), [str(found)])
    given = assumptions(context, force, tolerance)
    call |= {"scheduler": scheduler, "progress": False if as_json else None}
    if statistics:
        return whole_map(m, stiffmap.map_statistics(m, **call), plane, given)
    target = make_folder(output) / ("map.zarr" if zarr else "map.nc")
    ds = stiffmap.error_map(m, **call, out=target, resume=resume).load()
    result = MapSummary(m, ds, plane, MM * tolerance, given, how["gravity"], uncertainty)
    files = [target, *write_map_files(result, output, kinds, sheets, own_scales)]
    return Answer(result.as_plain(files), result.lines(), files, finding=bool(result.failed))


def planes(across: dict[str, list[float] | None]) -> dict[str, Any]:
    """Planes (m) across one axis; none where none are given."""
    given = {a: MM * np.array(v) for a, v in across.items() if v}
    if len(given) > 1:
        raise StiffmapError(f"--{' and --'.join(given)}: expected planes across one axis")
    return given


def named_formats(text: str, option: str, known: Sequence[str]) -> list[str]:
    """Endings of files, separated by commas."""
    kinds = [k.strip().lower() for k in text.split(",")]
    if not set(kinds) <= set(known):
        several = ",".join(known[:2])
        raise StiffmapError(f"{option}: expected {', '.join(known)}, or several as {several}; got '{text}'")
    return kinds


def cases(plane: str, text: str) -> dict[str, list[float]]:
    """The force that is given as a vector; of a size, forces along the axes of the plane."""
    size, vector = force_given(text)
    magnitude(size, "--force", "N")
    if vector is not None:
        return {"F": [*vector, 0.0, 0.0, 0.0]}
    return {f"F{'xyz'[i]}": [size if k == i else 0.0 for k in range(6)] for i in plane_axes(plane)}


def whole_map(machine: Machine, ds: xr.Dataset, plane: str, given: str) -> Answer:
    """Figures of a map that is not stored."""
    rows = statistics_rows(ds, plane)
    counts = {s.name: int(ds.status_count.sel(status=int(s)).sum()) for s in Status if s}
    failed = {name: count for name, count in counts.items() if count}
    lost = failed_in_words(failed, "solves of the load cases")
    data = {"machine": machine.name, "rows": rows, "failed": failed}
    return Answer(data, [given, _statistics_table(ds, plane, rows), *lost], finding=bool(failed))


def _statistics_table(ds: xr.Dataset, plane: str, rows: list[dict[str, Any]]) -> Table:
    percent = [f"{p:g} %" for p in ds.percentile.values]
    out = table(
        f"{ds.attrs['machine']}: deflection in the {plane} plane, mm, under {ds.attrs['turning_force_N']:g} N",
        ("z, mm", "force", *percent, "max", "at x, y", f"within {1e3 * ds.attrs['tolerance_m']:g} mm"),
        left=("force",),
    )
    for r in rows:
        values = (f"{1e3 * v:.3f}" for v in (*r["percentiles"].values(), r["max"]))
        place = f"{1e3 * r['at'][0]:.0f}, {1e3 * r['at'][1]:.0f}"
        name, share = label(ds, plane, r["force"]), f"{100 * r['share_within']:.1f} %"
        out.add_row(f"{1e3 * r['z']:g}", name, *values, place, share)
    return out


def map_toolpath(
    m: Machine, toolpath: str, force: str, how: dict[str, Any], output: Path, pictures: list[str]
) -> Answer:
    """Solve along the path: its worst place; table, data and pictures are written."""
    from stiffmap.workspace.performance import load_motion
    from stiffmap.workspace.performance.motion.trajectory import way_along

    position, given = load_motion(toolpath).places()
    must_take(m, position)
    load = given if given.any() else _load(m, position, force, how)
    wrench = np.hstack([load, np.zeros_like(load)])
    s = m.solve(position, wrench, **how)
    way = way_along(position)
    ds = s.to_xarray(("way",), {"way": ("way", way, {"units": "m"})})
    ds = ds.assign(position=(("way", "axis"), position), force=(("way", "axis"), load))
    files = write_files(output, _toolpath_files(ds, m.name, pictures))
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
    return Answer(data, [told, lost], files, finding=failed > 0)


def _load(m: Machine, position: Floats, force: str, how: dict[str, Any]) -> Floats:
    """(n, 3) N: the vector given; of a size, in the direction that pushes the tool furthest at each pose."""
    size, vector = force_given(force)
    if vector is not None:
        return np.broadcast_to(vector, position.shape)
    c = m.solve(position, None, **how).compliance[:, :3, :3]
    right = np.linalg.svd(np.nan_to_num(c))[2]
    return np.asarray(size * right[:, 0])


def _toolpath_files(ds: xr.Dataset, name: str, kinds: list[str]) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot.paths import toolpath_figure

    yield "toolpath.nc", ds
    head = ["way [mm]", "x [mm]", "y [mm]", "z [mm]", "fx [N]", "fy [N]", "fz [N]",
            "dx [mm]", "dy [mm]", "dz [mm]", "deflection [mm]"]  # fmt: skip
    columns = np.column_stack([
        ds.way.values / MM, ds.position.values / MM, ds.force.values,
        ds.displacement.values[:, :3] / MM, ds.deflection.values / MM,
    ])  # fmt: skip
    yield "toolpath.csv", (head, (list(map(repr, row)) for row in columns.tolist()))
    pictured = toolpath_figure(ds, name) if kinds else None
    yield from ((f"toolpath.{kind}", pictured) for kind in kinds)

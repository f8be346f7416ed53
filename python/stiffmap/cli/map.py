"""``stiffmap map``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from stiffmap.cli.inputs import (
    MM,
    EffectsOption,
    ForceOption,
    GravityOption,
    MachineArgument,
    MethodOption,
    PlaneOption,
    ThreadsOption,
    ToleranceOption,
    finish,
    folder,
    force_given,
    gravity,
    machine_with,
    plain,
)
from stiffmap.cli.map_big import print_estimate, print_statistics
from stiffmap.cli.map_summary import as_table, failures, summary
from stiffmap.cli.map_uncertainty import draw_deviations, print_uncertainty, uncertainty_data
from stiffmap.cli.map_worst import in_words, worst_pose
from stiffmap.cli.output import JsonOption, print_json
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.maps.table import write_map_table


def map_command(
    machine: MachineArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the map and its pictures.")
    ] = Path("stiffmap-map"),
    z: Annotated[
        list[float] | None,
        typer.Option(help="z-plane in mm; repeatable. [default: lowest, 0, highest of the workspace]"),
    ] = None,
    y: Annotated[list[float] | None, typer.Option(help="Planes across y instead, in mm; repeatable.")] = None,
    x: Annotated[list[float] | None, typer.Option(help="Planes across x instead, in mm; repeatable.")] = None,
    points: Annotated[
        int, typer.Option(help="Positions along each axis of a plane, over the whole workspace.")
    ] = 101,
    force: ForceOption = "300",
    plane: PlaneOption = "xy",
    tolerance: ToleranceOption = 0.25,
    directions: Annotated[
        int,
        typer.Option(
            help="Force directions solved before the extremes are searched; 16 or more "
            "for machines with play."
        ),
    ] = 4,
    effect: EffectsOption = None,
    gravity_: GravityOption = None,
    compliance: Annotated[bool, typer.Option(help="Keep the 6x6 compliance of every pose.")] = False,
    uncertainty: Annotated[
        bool,
        typer.Option("--uncertainty", help="Standard deviation of the map, from links and `u` of the file."),
    ] = False,
    zarr: Annotated[bool, typer.Option("--zarr", help="Write Zarr instead of NetCDF.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Take up an interrupted run.")] = False,
    pictures: Annotated[bool, typer.Option(help="Draw the maps.")] = True,
    formats: Annotated[
        str, typer.Option("--format", help="Formats of the pictures: png, svg, pdf, or several as png,pdf.")
    ] = "png",
    tables: Annotated[
        str | None, typer.Option("--table", help="Write the map as a table too: csv, xlsx, or csv,xlsx.")
    ] = None,
    own_scales: Annotated[
        bool, typer.Option("--own-scales", help="A colour scale for each plane instead of a common one.")
    ] = False,
    estimate: Annotated[
        bool,
        typer.Option("--estimate", help="Only say how long it will take, and the memory and disk it needs."),
    ] = False,
    statistics: Annotated[
        bool, typer.Option("--statistics", help="Maxima, percentiles and shares only; no map is stored.")
    ] = False,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask scheduler whose workers solve the map.")
    ] = None,
    method: MethodOption = "fast",
    threads: ThreadsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Error maps of z-planes: how far a force in the plane pushes the tool off its commanded position.

    The default is the paper's Figure 7: 300 N, z = -200, 0 and 300 mm over the whole xy workspace,
    deflection in the plane. The paper does not say where its force points: mapped are the worst
    direction at every position, the best one, Fx and Fy. A force that is given as a vector is mapped
    beside the worst and the best direction of its size.

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
    """
    import stiffmap

    kinds = named_formats(formats, "--format", ("png", "svg", "pdf"))
    sheets = named_formats(tables, "--table", ("csv", "xlsx")) if tables else []
    m = machine_with(machine, effect)
    call: dict[str, Any] = {
        **grid(m, {"x": x, "y": y, "z": z}, points),
        "wrench": cases(plane, force),
        "plane": plane,
        "directions": directions,
        "tolerance": MM * tolerance,
        "gravity": gravity(gravity_),
        "compliance": compliance,
        "uncertainty": uncertainty,
        "method": method,
        "threads": threads,
    }
    if estimate:
        print_estimate(m, call, as_json)
        return
    if statistics:
        print_statistics(m, call, plane, scheduler, as_json)
        return
    target = folder(output) / ("map.zarr" if zarr else "map.nc")
    ds = stiffmap.error_map(
        m,
        **call,
        scheduler=scheduler,
        progress=False if as_json else None,
        out=target,
        resume=resume,
    )
    files = [target, *(draw(ds, output, plane, MM * tolerance, kinds, own_scales) if pictures else [])]
    files += [write_map_table(ds, output / f"map.{kind}") for kind in sheets]
    band = uncertainty_data(ds, plane) if uncertainty else None
    files += draw_deviations(ds, output, plane) if uncertainty and pictures else []
    rows = summary(ds, plane, MM * tolerance)
    blame = worst_pose(m, ds, call["gravity"])
    if as_json:
        data: dict[str, Any] = {"machine": m.name, "rows": rows, "failed": failures(ds)}
        data |= {"files": list(map(str, files)), "worst_pose": blame}
        print_json(plain(data if band is None else data | {"uncertainty": band}))
    else:
        console = Console(highlight=False)
        console.print(as_table(ds, rows, plane, tolerance))
        if band is not None:
            print_uncertainty(console, band, plane)
        if blame is not None:
            console.print(in_words(blame), soft_wrap=True)
        for name, count in failures(ds).items():
            console.print(f"[yellow]{count} poses: {name}[/yellow]")
        console.print(f"wrote {', '.join(map(str, files))}", soft_wrap=True)
    finish(bool(failures(ds)))


def grid(machine: Machine, planes: dict[str, list[float] | None], points: int) -> dict[str, Any]:
    """Axes (m) over the workspace box; a coordinate that is not commanded has one value, its home."""
    given = {a: MM * np.array(v) for a, v in planes.items() if v}
    if len(given) > 1:
        raise StiffmapError(f"--{' and --'.join(given)}: expected planes across one axis")
    low, high = machine.workspace
    task = machine.description.task
    out: dict[str, Any] = {}
    for i, a in enumerate("xyz"):
        if a in given:
            out[a] = given[a]
        elif task and a not in task:
            out[a] = [float(machine.description.home.p[i])]
        elif a == "z" and not given:
            middle = 0.0 if low[2] < 0 < high[2] else (low[2] + high[2]) / 2
            out[a] = [low[2], middle, high[2]]
        else:
            out[a] = np.linspace(low[i], high[i], max(points, 0))
    if task and np.size(out["x"]) == np.size(out["y"]) == 1 and not given:
        out["z"] = np.linspace(low[2], high[2], max(points, 0))  # only the height is commanded
    return out


def named_formats(text: str, option: str, known: Sequence[str]) -> list[str]:
    """Endings of files, separated by commas."""
    kinds = [k.strip().lower() for k in text.split(",")]
    if not set(kinds) <= set(known):
        several = ",".join(known[:2])
        raise StiffmapError(f"{option}: expected {', '.join(known)}, or several as {several}; got '{text}'")
    return kinds


def cases(plane: str, text: str) -> dict[str, list[float]]:
    """The force that is given as a vector; of a size, forces along the axes of the plane."""
    from stiffmap.maps.inputs import magnitude, plane_axes

    size, vector = force_given(text)
    magnitude(size, "--force", "N")
    if vector is not None:
        return {"F": [*vector, 0.0, 0.0, 0.0]}
    return {f"F{'xyz'[i]}": [size if k == i else 0.0 for k in range(6)] for i in plane_axes(plane)}


def draw(
    ds: Any, output: Path, plane: str, tolerance: float, kinds: Sequence[str] = ("png",), own: bool = False
) -> list[Path]:
    """One picture per reading of the force's direction."""
    from stiffmap.plot import map_figure, save

    chosen: dict[str, dict[str, Any]] = {
        w: {"variable": f"{w}_deflection_{plane}"} for w in ("worst", "best")
    }
    chosen |= {str(c): {"variable": f"deflection_{plane}", "case": str(c)} for c in ds.case.values}
    figures = {
        name: map_figure(ds, tolerance=tolerance, common_scale=not own, **how) for name, how in chosen.items()
    }
    return [save(f, output / f"map-{name}.{kind}") for name, f in figures.items() for kind in kinds]

"""``stiffmap map``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from stiffmap.cli.inputs import (
    MM,
    EffectsOption,
    GravityOption,
    MachineArgument,
    MethodOption,
    PlaneOption,
    ThreadsOption,
    ToleranceOption,
    finish,
    folder,
    gravity,
    machine_with,
    plain,
)
from stiffmap.cli.map_summary import as_table, failures, summary
from stiffmap.cli.map_uncertainty import draw_deviations, print_uncertainty, uncertainty_data
from stiffmap.cli.output import JsonOption, print_json
from stiffmap.machine import Machine


def map_command(
    machine: MachineArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the map and its pictures.")
    ] = Path("stiffmap-map"),
    z: Annotated[
        list[float] | None,
        typer.Option(help="z-plane in mm; repeatable. [default: lowest, 0, highest of the workspace]"),
    ] = None,
    points: Annotated[
        int, typer.Option(help="Positions along x and along y, over the whole workspace.")
    ] = 101,
    force: Annotated[float, typer.Option(help="Size of the force, N.")] = 300.0,
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
    method: MethodOption = "fast",
    threads: ThreadsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Error maps of z-planes: how far a force in the plane pushes the tool off its commanded position.

    The default is the paper's Figure 7: 300 N, z = -200, 0 and 300 mm over the whole xy workspace,
    deflection in the plane. The paper does not say where its force points: mapped are the worst
    direction at every position, the best one, Fx and Fy.

    Exit codes: 0 done, 1 some poses failed (they hold NaN and their status), 2 bad input.

    Examples:

      [cyan]stiffmap map orthoglide-revised -o results[/cyan]

      [cyan]stiffmap map my_machine.yaml --uncertainty --points 21[/cyan]

      [cyan]stiffmap map tripteron --force 100 --points 41 --z 300 --z 500[/cyan]

      [cyan]stiffmap map orthoglide-revised --gravity 0,0,-9.81 --tolerance 0.1 --json[/cyan]
    """
    import stiffmap

    target = folder(output) / ("map.zarr" if zarr else "map.nc")
    m = machine_with(machine, effect)
    ds = stiffmap.error_map(
        m,
        **grid(m, z, points),
        wrench=cases(plane, force),
        plane=plane,
        directions=directions,
        tolerance=MM * tolerance,
        gravity=gravity(gravity_),
        compliance=compliance,
        uncertainty=uncertainty,
        method=method,
        threads=threads,
        progress=False if as_json else None,
        out=target,
        resume=resume,
    )
    files = [target, *(draw(ds, output, plane, MM * tolerance) if pictures else [])]
    band = uncertainty_data(ds, plane) if uncertainty else None
    files += draw_deviations(ds, output, plane) if uncertainty and pictures else []
    rows = summary(ds, plane, MM * tolerance)
    if as_json:
        data = {"machine": m.name, "rows": rows, "failed": failures(ds), "files": list(map(str, files))}
        print_json(plain(data if band is None else data | {"uncertainty": band}))
    else:
        console = Console(highlight=False)
        console.print(as_table(ds, rows, plane, tolerance))
        if band is not None:
            print_uncertainty(console, band, plane)
        for name, count in failures(ds).items():
            console.print(f"[yellow]{count} poses: {name}[/yellow]")
        console.print(f"wrote {', '.join(map(str, files))}", soft_wrap=True)
    finish(bool(failures(ds)))


def grid(machine: Machine, z: list[float] | None, points: int) -> dict[str, Any]:
    """Axes (m) over the workspace box."""
    low, high = machine.workspace
    middle = 0.0 if low[2] < 0 < high[2] else (low[2] + high[2]) / 2
    count = max(points, 0)
    return {
        "x": np.linspace(low[0], high[0], count),
        "y": np.linspace(low[1], high[1], count),
        "z": [low[2], middle, high[2]] if not z else MM * np.array(z),
    }


def cases(plane: str, force: float) -> dict[str, list[float]]:
    """Forces along the axes of the plane."""
    from stiffmap.maps.inputs import magnitude, plane_axes

    size = magnitude(force, "--force", "N")
    return {f"F{'xyz'[i]}": [size if k == i else 0.0 for k in range(6)] for i in plane_axes(plane)}


def draw(ds: Any, output: Path, plane: str, tolerance: float) -> list[Path]:
    """One picture per reading of the force's direction."""
    from stiffmap.plot import map_figure, save

    chosen: dict[str, dict[str, Any]] = {
        w: {"variable": f"{w}_deflection_{plane}"} for w in ("worst", "best")
    }
    chosen |= {str(c): {"variable": f"deflection_{plane}", "case": str(c)} for c in ds.case.values}
    return [
        save(map_figure(ds, tolerance=tolerance, **how), output / f"map-{name}.png")
        for name, how in chosen.items()
    ]

"""``stiffmap sweep``."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import typer
import xarray as xr
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.common.outputs import make_folder
from stiffmap.common.plain import plain
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import (
    MM,
    EffectsOption,
    FolderOption,
    GravityOption,
    MachineArgument,
    MethodOption,
    ToleranceOption,
    finish,
    gravity,
    machine_with,
    numbers,
    position,
)
from stiffmap.ui.cli.output import JsonOption, print_json
from stiffmap.ui.cli.path import path


def sweep(
    machine: MachineArgument,
    at: Annotated[str | None, typer.Option(help="TCP position in mm, e.g. 0,0,300. [default: home]")] = None,
    direction: Annotated[str, typer.Option(help="Direction of the force, any length.")] = "1,0,0",
    to: Annotated[float, typer.Option(help="Largest force, N.")] = 1000.0,
    from_: Annotated[
        float, typer.Option("--from", help="Smallest force, N; negative: against the direction.")
    ] = 0.0,
    points: Annotated[int, typer.Option(help="Number of forces, or of steps to the limit.")] = 21,
    control: Annotated[
        str, typer.Option(help="With --limit: force, displacement (past limit points) or arc.")
    ] = "force",
    limit: Annotated[
        float | None,
        typer.Option(help="Follow one path of equilibria to this force (N) or displacement (mm)."),
    ] = None,
    cross: Annotated[
        int,
        typer.Option(
            help="With --limit: follow the branch that crosses at this bifurcation, 1, 2 …; -1: to the other side."
        ),
    ] = 0,
    tolerance: ToleranceOption = 0.25,
    effect: EffectsOption = None,
    gravity_: GravityOption = None,
    output: FolderOption = None,
    method: MethodOption = "fast",
    as_json: JsonOption = False,
) -> None:
    """Deflection against the size of a force of one direction.

    Unstable equilibria are kept and named; a force without any equilibrium has no value. With --limit,
    one path of equilibria is followed instead, with its buckling loads and modes.

    With -o: pictures (PNG) and the data (NetCDF).

    Exit codes: 0 done, 1 some equilibria are unstable or were not found, 2 bad input.

    Examples:

      [cyan]stiffmap sweep orthoglide-revised --at -200,-200,-200 --direction 1,1,0 -o results[/cyan]

      [cyan]stiffmap sweep orthoglide-revised --from 0 --to 8000 --points 41[/cyan]

      [cyan]stiffmap sweep linear-delta --direction 0,0,-1 --control displacement --limit 20 -o out[/cyan]
    """
    import stiffmap

    m = machine_with(machine, effect)
    if limit is not None or control != "force" or cross:
        reach = limit if limit is None or control == "force" else MM * limit
        path(
            m,
            position(at, m),
            numbers(direction, "direction", 3),
            control,
            reach,
            points,
            cross,
            gravity(gravity_),
            output,
            as_json,
        )
        return
    forces = np.linspace(from_, to, max(points, 0))
    place, u = position(at, m), numbers(direction, "direction", 3)
    ds = stiffmap.sweep(m, place, u, forces, gravity=gravity(gravity_), method=method)
    files = write(ds, make_folder(output), MM * tolerance) if output else []
    if as_json:
        names = ("position", "direction", "force", "deflection", "deflection_along", "displacement", "status")
        print_json(plain({"machine": m.name} | {n: ds[n].values for n in names} | {"files": files}))
    else:
        console = Console(highlight=False)
        console.print(as_table(ds))
        if files:
            console.print(f"wrote {', '.join(files)}", soft_wrap=True)
    finish(bool((ds.status != Status.CONVERGED).any()))


def write(ds: xr.Dataset, output: Any, tolerance: float) -> list[str]:
    """Picture and data."""
    from stiffmap.ui.plot import save, sweep_figure
    from stiffmap.workspace.maps.files import write_dataset

    u = ", ".join(f"{v:.3g}" for v in ds.direction.values)
    figure = sweep_figure({f"along ({u})": ds}, variable="deflection", tolerance=tolerance)
    return [str(write_dataset(ds, output / "sweep.nc")), str(save(figure, output / "sweep.png"))]


def as_table(ds: xr.Dataset) -> Table:
    """Force, deflection, status."""
    place = ", ".join(f"{1e3 * v:g}" for v in ds.position.values)
    table = Table(box=box.SIMPLE_HEAD, title=f"{ds.attrs['machine']} at ({place}) mm")
    for head in ("force, N", "deflection, mm", "along the force, mm", "compliance, µm/N", "status"):
        table.add_column(head, justify="left" if head == "status" else "right")
    for i, force in enumerate(ds.force.values):
        values = [1e3 * float(ds[n][i]) for n in ("deflection", "deflection_along")]
        values.append(1e6 * float(ds.compliance_along[i]))
        text = (f"{v:.4f}" if np.isfinite(v) else "–" for v in values)
        table.add_row(f"{force:g}", *text, Status(int(ds.status[i])).name.lower())
    return table

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import typer
import xarray as xr
from rich.table import Table

import stiffmap
from stiffmap.common.number_text import place_text
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, machine_at, numbers, refuse_unused
from stiffmap.ui.cli.options import how_many, option
from stiffmap.ui.cli.output import Answer, table, write_files
from stiffmap.workspace.maps.inputs import magnitude


def command(
    context: typer.Context,
    machine: options.Machine,
    at: options.At = None,
    direction: str = option("Direction of the force, any length.", "1,0,0"),
    to: float = option("Largest force, N.", 1000.0),
    from_: float = option("Smallest force, N; negative: against the direction.", 0.0, "--from"),
    points: int = how_many("Number of forces, or of steps to the limit.", 21),
    control: str = option("With --limit: force, displacement (past limit points) or arc.", "force"),
    limit: float | None = option("Follow one path of equilibria to this force (N) or displacement (mm)."),
    cross: int = option(
        "With --limit: follow the branch that crosses at this bifurcation, 1, 2 …; -1: to the other side.", 0
    ),
    tolerance: options.Tolerance = 0.25,
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    output: options.Folder = None,
    method: options.Method = "fast",
) -> Answer:
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
    refuse_unused(context, {"with limit": "from_ to tolerance method"})
    tolerance = MM * magnitude(tolerance, "--tolerance", "mm")
    m, place, posed = machine_at(machine, effect, at, acting=gravity_)
    path = limit is not None or control != "force" or bool(cross)
    how: dict[str, Any] = {"forces": np.linspace(from_, to, max(points, 0)), "method": method}
    if path:
        reach = limit if limit is None or control == "force" else MM * limit
        how = {"control": control, "limit": reach, "steps": points, "cross": cross}
    ds = stiffmap.sweep(m, place, numbers(direction, "direction", 3), **posed, **how)
    files = write_files(output, _path_files(m, ds) if path else _files(ds, tolerance))
    counted = ds.assign(unstable_modes=ds.unstable_modes.astype(int)) if path else ds
    data = {"machine": m.name} | ({n: ds.attrs[n] for n in ("end", "crossing_end")} if path else {})
    data |= {n: counted[n].values for n in (OF_PATH if path else OF_FORCES)}
    early = path and ds.attrs["end"] != "the limit was reached"
    lost = early or bool((ds.status != Status.CONVERGED).any())
    return Answer(data, _path_lines(ds) if path else [as_table(ds)], files, finding=lost)


def _files(ds: xr.Dataset, tolerance: float) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot import sweep_figure

    u = ", ".join(f"{v:.3g}" for v in ds.direction.values)
    yield "sweep.nc", ds
    yield "sweep.png", sweep_figure({f"along ({u})": ds}, variable="deflection", tolerance=tolerance)


def as_table(ds: xr.Dataset) -> Table:
    """Force, deflection, status."""
    heads = ("force, N", "deflection, mm", "along the force, mm", "compliance, µm/N", "status")
    out = table(_place(ds), heads, left=("status",))
    for i, force in enumerate(ds.force.values):
        values = [1e3 * float(ds[n][i]) for n in ("deflection", "deflection_along")]
        values.append(1e6 * float(ds.compliance_along[i]))
        text = (f"{v:.4f}" if np.isfinite(v) else "–" for v in values)
        out.add_row(f"{force:g}", *text, Status(int(ds.status[i])).name.lower())
    return out


def _place(ds: xr.Dataset) -> str:
    return f"{ds.attrs['machine']} at {place_text(ds.position.values)}"


OF_FORCES = ("position", "direction", "force", "deflection", "deflection_along", "displacement", "status")
OF_PATH = ("force", "deflection", "deflection_along", "unstable_modes", "status", "branch", "critical_force",
           "critical_deflection", "critical_kind", "mode_leg", "mode_joint")  # fmt: skip
SHOWN = 20


def _path_files(machine: Machine, ds: xr.Dataset) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot import mode_figure, path_figure

    yield "path.nc", ds
    yield "path.png", path_figure(ds)
    for i in range(ds.sizes["critical"]):
        yield f"mode_{i + 1}.png", mode_figure(machine, ds, i)


def _path_lines(ds: xr.Dataset) -> Iterator[str | Table]:
    """Some points of the path, and what happened on it."""
    out = table(_place(ds), ("force, N", "along the force, mm", "deflection, mm", "status"), left=("status",))
    branch = ds.branch.values
    for i in np.concatenate([_some(np.flatnonzero(branch == k)) for k in np.unique(branch)]):
        values = [float(ds.force[i]), 1e3 * float(ds.deflection_along[i]), 1e3 * float(ds.deflection[i])]
        out.add_row(*(f"{v:.4f}" for v in values), Status(int(ds.status[i])).name.lower())
        if i + 1 < branch.size and branch[i + 1] != branch[i]:
            out.add_section()
    yield out
    for i in range(ds.sizes["critical"]):
        leg = str(ds.mode_leg.values[i])
        more = abs(int(ds.unstable_after[i]) - int(ds.unstable_before[i]))
        yield (
            f"{ds.critical_kind.values[i]} point at {float(ds.critical_force[i]):.6g} N, "
            f"{1e3 * float(ds.critical_deflection[i]):.6g} mm; mode: "
            + (f"leg {leg}, " if leg else "")
            + f"most in {ds.mode_joint.values[i]}"
            + (f"; {more} modes within one step" if more > 1 else "")
        )
    yield f"end: {ds.attrs['end']}"
    if (ds.branch == 1).any():
        yield f"end of the crossing branch: {ds.attrs['crossing_end']}"


def _some(steps: Any) -> Any:
    """At most SHOWN of some steps, the first and the last among them."""
    return steps[np.unique(np.linspace(0, len(steps) - 1, SHOWN).astype(int))]

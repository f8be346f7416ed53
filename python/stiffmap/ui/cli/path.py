"""``stiffmap sweep --limit``: one path of equilibria."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.common.broadcasting import Floats
from stiffmap.common.outputs import make_folder
from stiffmap.common.plain import plain
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import finish
from stiffmap.ui.cli.output import print_json

SHOWN = 20


def path(
    machine: Machine,
    at: Floats,
    direction: Floats,
    control: str,
    limit: float | None,
    steps: int,
    cross: int,
    gravity: Any,
    output: Path | None,
    as_json: bool,
) -> None:
    """Follow the path, print it, write it; exit with 1 where it ends early or is unstable somewhere."""
    import stiffmap

    ds = stiffmap.sweep(
        machine, at, direction, control=control, limit=limit, steps=steps, cross=cross, gravity=gravity
    )
    files = write(machine, ds, make_folder(output)) if output else []
    if as_json:
        counted = ds.assign(unstable_modes=ds.unstable_modes.astype(int))
        names = ("force", "deflection", "deflection_along", "unstable_modes", "status", "branch", "critical_force",
                 "critical_deflection", "critical_kind", "mode_leg", "mode_joint")  # fmt: skip
        print_json(plain({"machine": machine.name, "end": ds.attrs["end"], "crossing_end": ds.attrs["crossing_end"]}
                         | {n: counted[n].values for n in names} | {"files": files}))  # fmt: skip
    else:
        show(Console(highlight=False), ds)
        if files:
            print(f"wrote {', '.join(files)}")
    reached = ds.attrs["end"] == "the limit was reached"
    finish(not reached or bool((ds.status != Status.CONVERGED).any()))


def write(machine: Machine, ds: xr.Dataset, output: Path) -> list[str]:
    """Data, the path, and one picture per critical point."""
    from stiffmap.ui.plot import mode_figure, path_figure, save
    from stiffmap.workspace.maps.files import write_dataset

    files = [write_dataset(ds, output / "path.nc"), save(path_figure(ds), output / "path.png")]
    for i in range(ds.sizes["critical"]):
        files.append(save(mode_figure(machine, ds, i), output / f"mode_{i + 1}.png"))
    return [str(f) for f in files]


def show(console: Console, ds: xr.Dataset) -> None:
    """Some points of the path, and what happened on it."""
    place = ", ".join(f"{1e3 * v:g}" for v in ds.position.values)
    table = Table(box=box.SIMPLE_HEAD, title=f"{ds.attrs['machine']} at ({place}) mm")
    for head in ("force, N", "along the force, mm", "deflection, mm", "status"):
        table.add_column(head, justify="left" if head == "status" else "right")
    branch = ds.branch.values
    for i in np.concatenate([_some(np.flatnonzero(branch == k)) for k in np.unique(branch)]):
        values = [float(ds.force[i]), 1e3 * float(ds.deflection_along[i]), 1e3 * float(ds.deflection[i])]
        table.add_row(*(f"{v:.4f}" for v in values), Status(int(ds.status[i])).name.lower())
        if i + 1 < branch.size and branch[i + 1] != branch[i]:
            table.add_section()
    console.print(table)
    for i in range(ds.sizes["critical"]):
        leg = str(ds.mode_leg.values[i])
        more = abs(int(ds.unstable_after[i]) - int(ds.unstable_before[i]))
        console.print(
            f"{ds.critical_kind.values[i]} point at {float(ds.critical_force[i]):.6g} N, "
            f"{1e3 * float(ds.critical_deflection[i]):.6g} mm; mode: "
            + (f"leg {leg}, " if leg else "")
            + f"most in {ds.mode_joint.values[i]}"
            + (f"; {more} modes within one step" if more > 1 else ""),
            soft_wrap=True,
        )
    console.print(f"end: {ds.attrs['end']}")
    if (ds.branch == 1).any():
        console.print(f"end of the crossing branch: {ds.attrs['crossing_end']}")


def _some(steps: Any) -> Any:
    """At most SHOWN of some steps, the first and the last among them."""
    return steps[np.unique(np.linspace(0, len(steps) - 1, SHOWN).astype(int))]

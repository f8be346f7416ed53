"""``stiffmap stress``."""

from __future__ import annotations

from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.common.outputs import make_folder
from stiffmap.common.plain import plain
from stiffmap.solve.internal_wrenches import InternalWrenches
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import (
    EffectsOption,
    FolderOption,
    GravityOption,
    MachineArgument,
    RotationOption,
    finish,
    gravity,
    machine_with,
    position,
    rotation,
)
from stiffmap.ui.cli.output import JsonOption, print_json


def stress(
    machine: MachineArgument,
    at: Annotated[str | None, typer.Option(help="Commanded TCP in mm, e.g. 0,0,300. [default: home]")] = None,
    turned: RotationOption = None,
    effect: EffectsOption = None,
    gravity_: GravityOption = None,
    output: FolderOption = None,
    as_json: JsonOption = False,
) -> None:
    """Wrenches inside a machine that carries nothing: geometric errors of over-constrained legs, preload.

    With -o: a picture (PNG).

    Exit codes: 0 converged, 1 any other status, 2 bad input.

    Examples:

      [cyan]stiffmap stress my_machine.yaml --at 0,200[/cyan]

      [cyan]stiffmap stress swing-table --gravity 0,0,-9.81 -o out[/cyan]
    """
    import stiffmap

    m = machine_with(machine, effect)
    none = (0.0, 0.0, 0.0)
    result = stiffmap.assembly_wrenches(
        m, position(at, m), rotation=rotation(turned), gravity=none if gravity_ is None else gravity(gravity_)
    )
    files = []
    if output:
        from stiffmap.ui.plot import save, stress_figure

        files.append(
            str(
                save(
                    stress_figure(result, f"{m.name}: internal wrenches"), make_folder(output) / "stress.png"
                )
            )
        )
    status = Status(int(result.status))
    if as_json:
        print_json(
            plain(
                {
                    "machine": m.name,
                    "status": status.name,
                    "springs": result.springs,
                    "joints": result.joints,
                    "legs": result.legs,
                    "displacement": result.displacement,
                    "files": files,
                }
            )
        )
    else:
        console = Console(highlight=False)
        console.print(f"status {status.name.lower()}")
        console.print(_table(result))
        if files:
            console.print(f"wrote {', '.join(files)}", soft_wrap=True)
    finish(status != Status.CONVERGED)


def _table(result: InternalWrenches) -> Table:
    table = Table(box=box.SIMPLE_HEAD, title="springs, in their own axes")
    table.add_column("spring")
    for head in ("fx, N", "fy, N", "fz, N", "mx, N m", "my, N m", "mz, N m"):
        table.add_column(head, justify="right")
    for name, w in result.springs.items():
        table.add_row(name, *(f"{v:.4f}" for v in w))
    return table

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import stiffmap
from stiffmap.solve.internal_wrenches import InternalWrenches
from stiffmap.solve.status import Status
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import machine_at
from stiffmap.ui.cli.output import Answer, table, write_files


def command(
    machine: options.Machine,
    at: options.At = None,
    turned: options.Rotation = None,
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
    output: options.Folder = None,
) -> Answer:
    """Wrenches inside a machine that carries nothing: geometric errors of over-constrained legs, preload.

    With -o: a picture (PNG).

    Exit codes: 0 converged, 1 any other status, 2 bad input.

    Examples:
      [cyan]stiffmap stress my_machine.yaml --at 0,200[/cyan]
      [cyan]stiffmap stress swing-table --gravity 0,0,-9.81 -o out[/cyan]
    """
    m, place, how = machine_at(machine, effect, at, turned, gravity_ or "0,0,0")
    result = stiffmap.assembly_wrenches(m, place, **how)
    files = write_files(output, _picture(result, m.name))
    status = Status(int(result.status))
    data = {"machine": m.name, "status": status.name} | {
        n: getattr(result, n) for n in ("springs", "joints", "legs", "displacement")
    }
    heads = ("spring", "fx, N", "fy, N", "fz, N", "mx, N m", "my, N m", "mz, N m")
    rows = ([name, *(f"{v:.4f}" for v in w)] for name, w in result.springs.items())
    return Answer(
        data,
        [f"status {status.name.lower()}", table("springs, in their own axes", heads, rows, left=("spring",))],
        files,
        finding=status != Status.CONVERGED,
    )


def _picture(result: InternalWrenches, name: str) -> Iterator[tuple[str, Any]]:
    from stiffmap.ui.plot import stress_figure

    yield "stress.png", stress_figure(result, f"{name}: internal wrenches")

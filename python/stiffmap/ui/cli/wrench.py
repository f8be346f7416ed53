from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.solve.status import Status
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import MM, machine_at, numbers
from stiffmap.ui.cli.options import option
from stiffmap.ui.cli.output import Answer


def command(
    machine: options.Machine,
    at: options.At = None,
    by: str = option("Imposed translation of the point in mm, base axes.", "0,0,0"),
    turn: str = option("Imposed rotation vector in deg, base axes.", "0,0,0"),
    turned: options.Rotation = None,
    point: str = option("Named point that is held.", "tcp"),
    effect: options.Effects = None,
    gravity_: options.Gravity = None,
) -> Answer:
    """Wrench that holds a machine at a displacement from its commanded pose, whole and per leg.

    Exit codes: 0 converged, 1 any other status, 2 bad input.

    Examples:
      [cyan]stiffmap wrench orthoglide-revised --at 0,0,200 --by 0.1,0,0[/cyan]
      [cyan]stiffmap wrench hexapod --by 0,0,-0.2 --turn 0,0.01,0 --json[/cyan]
    """
    m, place, how = machine_at(machine, effect, at, turned, gravity_)
    displacement = np.r_[MM * numbers(by, "by", 3), np.deg2rad(numbers(turn, "turn", 3))]
    held = m.wrench(place, displacement, point=point, **how)
    data: dict[str, Any] = {"machine": m.name, "point": point, "displacement": displacement} | held.as_plain()
    told = [f"status {data['status'].lower()}; without the clamp: {data['status_without_clamp'].lower()}"]
    parts = {f"leg {n} on platform": w for n, w in zip(held.legs, held.leg_wrench, strict=True)}
    for name, w in {"whole machine": held.wrench, **parts}.items():
        force, moment = (", ".join(f"{v:.4f}" for v in part) for part in (w[:3], w[3:]))
        told.append(f"{name}: force ({force}) N, moment about {point} ({moment}) N m")
    return Answer(data, told, finding=int(held.status) != Status.CONVERGED)

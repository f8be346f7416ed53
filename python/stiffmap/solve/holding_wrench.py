"""The inverse problem, equation (10) of the paper: from an imposed displacement to wrenches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, batch, one_of, rows, thread_count, trailing
from stiffmap.common.json_text import plain
from stiffmap.common.short import short_repr
from stiffmap.solve.closing import commanded
from stiffmap.solve.compiled import CompiledMachine, Flag, Status
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.status import status_of_one


@short_repr
@dataclass(frozen=True, eq=False)
class HoldingWrench(OverPoses):
    """A batch of poses with a point of the machine held; SI, base axes, moments about the point.

    Failed poses hold NaN and their status.
    """

    wrench: Floats
    """(..., 6) that holds the machine there: what a dead load at the point would have to be.
    Components that rigid parts leave open are NaN (flag RIGID_DIRECTION), and so are the legs' then."""
    leg_wrench: Floats
    """(..., legs, 6) leg on platform, about the point."""
    stiffness: Floats
    """(..., 6, 6) small extra twist to small extra dead wrench; also where the platform is singular."""
    leg_stiffness: Floats
    """(..., legs, 6, 6) small extra twist of the point to minus the change of the leg's wrench. The
    first leg's is what the others leave of the whole, so it contains external springs at the platform."""
    actuator_effort: Floats
    """(..., actuators) N or N·m."""
    coordinates: Floats
    """(..., coordinates)."""
    status: NDArray[np.uint8]
    """(...) of `Status`, with the point held."""
    force_status: NDArray[np.uint8]
    """(...) of `Status` if the wrench acted and nothing held the point: SINGULAR or UNSTABLE is where
    `Machine.solve` has no answer."""
    flags: NDArray[np.uint32]
    """(...) bits of `Flag`."""
    point: str
    legs: tuple[str, ...]
    actuators: tuple[str, ...]

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(...) where the status is CONVERGED."""
        return np.asarray(self.status == Status.CONVERGED)

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON of one pose, SI; StiffmapError for several."""
        data = {
            "point": self.point,
            "status": status_of_one(self.status).name,
            "status_without_clamp": Status(int(self.force_status)).name,
            "flags": [f.name for f in Flag(int(self.flags))],
            "wrench": self.wrench,
            "leg_wrench": dict(zip(self.legs, self.leg_wrench, strict=True)),
            "stiffness": self.stiffness,
            "leg_stiffness": dict(zip(self.legs, self.leg_stiffness, strict=True)),
            "actuator_effort": dict(zip(self.actuators, self.actuator_effort, strict=True)),
        }
        return dict(plain(data))


def holding_wrench(
    machine: CompiledMachine,
    position: ArrayLike,
    displacement: ArrayLike,
    rotation: ArrayLike | None,
    point: str,
    gravity: ArrayLike | None,
    threads: int | None,
) -> HoldingWrench:
    """See `Machine.wrench`."""
    p, r = commanded(machine, position, rotation)
    d = trailing(displacement, (6,), "displacement", "displacements [dx dy dz rx ry rz] (m, rad)")
    one_of(point, machine.names.points, "point")
    shape = batch(p.shape[:-1], d.shape[:-1], r.shape[:-2])
    out = machine.core.clamp(
        rows(p, shape, (3,)),
        rows(r, shape, (3, 3)),
        rows(d, shape, (6,)),
        point=point,
        gravity=machine.gravity(gravity),
        threads=thread_count(threads),
    )
    arrays = {name: values.reshape(shape + values.shape[1:]) for name, values in out.items()}
    return HoldingWrench(**arrays, point=point, legs=machine.names.legs, actuators=machine.names.actuators)

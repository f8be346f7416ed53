"""Internal wrenches: what geometric errors and preload do inside a machine that carries nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, thread_count
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.model.description.tree import joint_of, joints
from stiffmap.solve.closing import loaded_poses
from stiffmap.solve.labels import OverPoses
from stiffmap.solve.machine import Machine, takes_machine


@short_repr
@dataclass(frozen=True, eq=False)
class InternalWrenches(OverPoses):
    """Wrenches inside a machine, leading batch axes (...); NaN for failed poses, with their status."""

    springs: dict[str, Floats]
    """Full name of each link spring -> (..., 6) N, N·m in the spring's axes: force and moment that
    the elastic part carries, positive where they stretch (or turn) it forwards."""
    joints: dict[str, Floats]
    """Full name of each drive and elastic joint -> (...) N or N·m along its coordinate."""
    legs: dict[str, Floats]
    """Leg -> (..., 6) N, N·m: leg on platform, about `point`, base axes."""
    displacement: Floats
    """(..., 6) m, rad: of the point against the commanded pose."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]
    point: str

    def largest(self) -> tuple[str, float]:
        """The spring with the largest force, and that force (N), NaN where every pose failed; StiffmapError without springs."""
        if not self.springs:
            raise StiffmapError("largest: the machine has no link springs")
        forces = {n: np.linalg.norm(w[..., :3], axis=-1) for n, w in self.springs.items()}
        sizes = {n: float(np.fmax.reduce(f, axis=None, initial=np.nan)) for n, f in forces.items()}
        name = max(sizes, key=lambda n: (sizes[n] >= 0, sizes[n]))
        return name, sizes[name]


@takes_machine
def assembly_wrenches(
    machine: Machine,
    position: ArrayLike,
    *,
    wrench: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    point: str = "tcp",
    gravity: ArrayLike | None = None,
    threads: int | None = None,
) -> InternalWrenches:
    """Internal wrenches at commanded poses, by default under the gravity of the machine file alone.

    They come from `actual` geometry that differs from the nominal one where legs are over-constrained
    (assembly), and from springs with a `rest` deflection (preload). Statically determinate legs
    carry none.

    position (..., 3) m; wrench (..., 6) at `point`, None: none; gravity (3,) m/s², None: what the
    machine file says. Raises StiffmapError for bad input.
    """
    s = machine.solve(
        position, wrench, rotation=rotation, point=point, gravity=gravity, threads=threads, method="reference"
    )
    shape, p, r, w = loaded_poses(machine.compiled, position, wrench, rotation)
    gravity = machine.compiled.gravity(gravity)
    force = machine.compiled.core.reactions(p, r, w, point, gravity, thread_count(threads))["force"]
    force = force.reshape((*shape, force.shape[-1]))
    named = joints(machine.description)
    sprung = {n for n in s.joint_index if (joint := joint_of(named, n)) is not None and any(joint.laws)}
    elastic = {n: i for n, i in s.joint_index.items() if n in machine.actuators or n in sprung}
    return InternalWrenches(
        springs={n: force[..., i : i + 6] for n, i in s.spring_index.items()},
        joints={n: force[..., i] for n, i in elastic.items()},
        legs={leg: s.leg_wrench[..., i, :] for i, leg in enumerate(machine.legs)},
        displacement=s.displacement,
        status=s.status,
        flags=s.flags,
        point=point,
    )

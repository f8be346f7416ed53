"""Commands at which the loaded machine stands on the path (theory.md, M9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.equilibrium import Equilibrium
from stiffmap.machining.milling.plant import Plant

STEPS = 40
DONE = 1e-11
"""m: distance from the path below which a command stands."""


@dataclass(frozen=True, eq=False)
class Commanded:
    """m points, base axes, m."""

    position: Floats
    """(m, 3) to command; NaN where the machine has no answer."""
    left: Floats
    """(m,) m: how far the model still is from the path there, under the force of the wanted cut."""
    mirror: Floats
    """(m, 3) the mirrored commands: the wanted position less the error."""


def commanded(plant: Plant, before: Equilibrium) -> Commanded:
    """Inverse of the loaded machine: on the path the cut is the wanted one, so that its force is known there."""
    job = plant.job
    force = job.force(np.zeros((len(job), 2)))
    steered = np.array([1.0 if axis in job.machine.description.task else 0.0 for axis in "xyz"])
    # the machine's tangent tells where the tool would stand under the wanted cut
    further = np.einsum("mij,mj->mi", before.compliance, force - before.force)
    u = job.position - steered * (np.nan_to_num(before.error) + np.nan_to_num(further))
    rest = np.full((len(job), 3), np.nan)
    active = np.arange(len(job))
    for _ in range(STEPS):
        s = plant.stand(u[active], force[active], rows=active)
        rest[active] = u[active] + s.moved - job.position[active]
        far = np.abs(steered * rest[active]).max(axis=1)
        go = far > DONE  # a lost point compares false
        u[active[go]] -= steered * rest[active[go]]
        active = active[go]
        if not active.size:
            break
    u[~np.isfinite(rest).all(axis=1)] = np.nan
    return Commanded(u, np.linalg.norm(rest, axis=1), job.position - steered * before.error)

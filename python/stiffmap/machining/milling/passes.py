"""Several passes along the same commands: each further one cuts what the last left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.equilibrium import Equilibrium, equilibrium
from stiffmap.machining.milling.plant import Plant
from stiffmap.machining.milling.setting import Setting


def after_passes(job: Setting, first: Equilibrium, passes: int, threads: int | None = None) -> Floats:
    """(passes, m) m: height of the wall over the wanted one after each pass; never below what a pass before it took."""
    wall = job.across(first.error)
    out = [wall]
    for _ in range(passes - 1):
        engaged = replace(
            job.engaged, radial=np.maximum(np.nan_to_num(wall), 0.0), corner=0 * job.engaged.corner
        )
        rest = replace(job, engaged=engaged)
        e = equilibrium(Plant(rest, threads=threads), job.position)
        wall = np.minimum(wall, job.across(e.error))
        out.append(wall)
    return np.array(out)

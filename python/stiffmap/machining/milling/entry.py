"""Where to enter a closed outline: the tool that enters is not yet pushed, so that it leaves a step as high as the error there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.machining.milling.equilibrium import equilibrium
from stiffmap.machining.milling.plant import Plant
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.toolpath.entry import outline_of


@dataclass(frozen=True)
class Entry:
    """A place on the outline."""

    way: float
    """m along the cuts, from where the path enters now."""
    step: float | None = None
    """m: size of the error across the wall there, before compensation, which is the step that the entry leaves; None: not searched for."""
    given: float | None = None
    """m: the same where the path enters now."""


def best_entry(job: Setting, threads: int | None = None) -> Entry:
    """The point of a closed outline with the least error across the wall; inside corners are none. Raises StiffmapError for other paths."""
    outline_of(job.path)
    e = equilibrium(Plant(job, threads=threads), job.position)
    size = np.abs(np.where(np.isfinite(e.error), e.error, np.inf) * job.off).sum(axis=1)
    normal = np.abs((np.nan_to_num(e.error) * job.off).sum(axis=1))
    normal = np.where(np.isfinite(size) & (job.engaged.corner == 0) & job.engaged.wall, normal, np.inf)
    k = int(np.argmin(normal))
    return Entry(float(job.points.way[k]), float(normal[k]), float(normal[0]))

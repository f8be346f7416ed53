"""Waves that the passing teeth leave, where they pass slowly enough for statics."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.equilibrium import Equilibrium
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.process import cutting_force
from stiffmap.workspace.performance.motion.frequencies import natural_frequencies

SLOW = 3.0
"""The lowest natural frequency must be this many times the tooth passing's."""


def ripple(job: Setting, state: Equilibrium) -> Floats:
    """(m,) m: amplitude across the wall at the tooth-passing frequency; 0 for a coated tool, NaN where the teeth pass
    too fast for statics or the machine declares no masses."""
    teeth = job.process.tool.teeth
    if not teeth:
        return np.zeros(len(job))
    force = cutting_force(job.process)
    try:
        lowest = float(
            np.min(
                natural_frequencies(
                    job.machine, job.position[:1], modes=1, rotation=job.rotation[:1]
                ).frequency
            )
        )
    except StiffmapError:
        lowest = 0.0
    if not lowest > SLOW * teeth * force.spindle_frequency:
        return np.full(len(job), np.nan)
    amplitude = np.einsum("i,mij->mj", force.amplitude[teeth - 1], np.abs(job.axes))
    return np.asarray(np.abs(np.einsum("mi,mij,mj->m", job.off, state.compliance, amplitude)))

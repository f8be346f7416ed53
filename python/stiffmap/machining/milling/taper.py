"""Tilt of the tool under load: the wall is further out or in at the top of the cut than at the tip."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.milling.equilibrium import Equilibrium
from stiffmap.machining.milling.setting import Setting


def taper(job: Setting, state: Equilibrium) -> Floats:
    """(m,) m across the wall, top of the cut less tip: the holder's turn, and the slope of a tool that bends (a cantilever's: 3/2 of
    its deflection over its length)."""
    depth, tool = job.engaged.axial, job.process.tool
    tilt = np.cross(state.turned, job.tool)
    if tool.compliance:
        across = state.force - (state.force * job.tool).sum(axis=1, keepdims=True) * job.tool
        tilt = tilt - 1.5 * tool.compliance / tool.stick_out * across
    return np.asarray(depth * (tilt * job.off).sum(axis=1))

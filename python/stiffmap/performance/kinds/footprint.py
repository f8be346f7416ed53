"""Ground that the machine stands over: the rectangle about everything of it, at the corners of the box."""

from __future__ import annotations

import numpy as np

from stiffmap.performance.closing import drive_kinematics
from stiffmap.performance.poses import box_nodes
from stiffmap.performance.registry import Case, Found, Measure
from stiffmap.status import Status


def compute(case: Case) -> Found:
    """Area in the base's xy plane of the frames of all bodies and joints."""
    k = drive_kinematics(case.machine, box_nodes(case.low, case.high, 2), case.rotation, threads=case.threads)
    if (k.status != Status.CONVERGED).any():
        return Found(float("nan"), note="a corner of the box is not within reach")
    points = np.concatenate([case.machine.compiled.frames(x)[0][1:] for x in k.coordinates])
    size = np.ptp(points, axis=0)
    return Found(float(size[0] * size[1]), note=f"{1e3 * size[0]:.0f} x {1e3 * size[1]:.0f} mm")


MEASURE = Measure("footprint", "ground that the machine stands over", "m^2", "low", compute, "m²", order=43)

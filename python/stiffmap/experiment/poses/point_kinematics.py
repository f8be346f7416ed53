"""Where a named point is where each row is commanded: nominal geometry, springs at rest."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.machine import Machine


def point_positions(machine: Machine, name: str, plan: Experiment) -> Floats:
    """(n, 3) m, base axes, of a point where each row is commanded; NaN where that is out of reach."""
    if name == "tcp":
        return plan.position
    found = coordinates_of(machine, plan)
    at = machine.compiled.point_positions(name, np.ascontiguousarray(found))
    return np.where(np.asarray(np.isfinite(found).all(axis=1))[:, None], at, np.nan)

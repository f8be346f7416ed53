"""Where a named point is where each row is commanded: nominal geometry, springs at rest."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.poses.once import Once
from stiffmap.solve.machine import Machine


def point_positions(machine: Machine, name: str, plan: Experiment) -> Floats:
    """(n, 3) m, base axes, of a point where each row is commanded; NaN where that is out of reach.

    Found out once for all machines of one geometry, as long as the plan lives; not to be written to.
    """
    if name == "tcp":
        return plan.position
    return _KNOWN.get(plan, machine, lambda: _found(machine, name, plan), name)


def positions_of(machine: Machine, plan: Experiment, read: tuple[str, ...]) -> Floats:
    """(n, 3) m, where the point of each row is as commanded."""
    at = {p: point_positions(machine, p, plan) for p in set(read)}
    return np.stack([at[p][i] for i, p in enumerate(read)])


_KNOWN: Once[Floats] = Once()


def _found(machine: Machine, name: str, plan: Experiment) -> Floats:
    found = coordinates_of(machine, plan)
    at = machine.compiled.point_positions(name, np.ascontiguousarray(found))
    return np.where(np.asarray(np.isfinite(found).all(axis=1))[:, None], at, np.nan)

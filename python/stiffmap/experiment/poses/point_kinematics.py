"""Where a named point is where each row is commanded: nominal geometry, springs at rest."""

from __future__ import annotations

from collections.abc import Hashable
from weakref import WeakKeyDictionary

import numpy as np

from stiffmap.description.rigid import nominal_geometry
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.machine import Machine


def point_positions(machine: Machine, name: str, plan: Experiment) -> Floats:
    """(n, 3) m, base axes, of a point where each row is commanded; NaN where that is out of reach.

    Found out once for all machines of one geometry, as long as the plan lives; not to be written to.
    """
    if name == "tcp":
        return plan.position
    known = _KNOWN.setdefault(plan, {})
    key = name, nominal_geometry(machine.description)
    if key not in known:
        known[key] = _found(machine, name, plan)
        known[key].flags.writeable = False
    return known[key]


_KNOWN: WeakKeyDictionary[Experiment, dict[Hashable, Floats]] = WeakKeyDictionary()


def _found(machine: Machine, name: str, plan: Experiment) -> Floats:
    found = coordinates_of(machine, plan)
    at = machine.compiled.point_positions(name, np.ascontiguousarray(found))
    return np.where(np.asarray(np.isfinite(found).all(axis=1))[:, None], at, np.nan)

"""What the readings of an experiment covered."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import WRENCH, Experiment
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.solve.machine import Machine
from stiffmap.solve.validity import Validity, drive_coordinates, kinds, range_of


def covered(machine: Machine, e: Experiment, keep: Mask) -> Validity:
    """Ranges of the rows in `keep` (n,)."""
    at = drive_coordinates(machine, coordinates_of(machine, e))
    warm = None if e.temperature is None else e.temperature[keep]
    return Validity(
        poses=len(np.unique(e.groups[keep])),
        drives={n: range_of(v[keep]) for n, v in at.items()},
        turning=frozenset(n for n, kind in kinds(machine).items() if kind != "prismatic"),
        loads={n: range_of(e.wrench[keep, i]) for i, n in enumerate(WRENCH) if e.wrench[keep, i].any()},
        temperature=None if warm is None or not np.isfinite(warm).any() else range_of(warm),
    )


def beyond(machine: Machine, e: Experiment) -> Mask | None:
    """(n,) rows that lie beyond what the readings of a calibrated machine covered; None: it was not calibrated."""
    v = Validity.of_machine(machine)
    if v is None:
        return None
    return v.outside(machine, coordinates_of(machine, e), e.wrench, e.temperature)

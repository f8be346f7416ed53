"""Zeros that are set anew in every set-up: a machine that is homed or adjusted between two sessions.

Nobody writes that down, so the readings are asked: a zero of each drive in each set-up, with the zero's own
standard uncertainty, in addition to those that all set-ups share, where the evidence gains by it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.identification.numbers.sensitivity import Sensitivity
from stiffmap.identification.numbers.unknowns import Unknown


def zeros_anew(s: Sensitivity, experiment: Experiment) -> Sensitivity | None:
    """The same unknowns and a zero of each drive per set-up; None where there is one set-up only."""
    names = np.unique(experiment.setup)
    zeros = [i for i, u in enumerate(s.unknowns) if u.group == "zeros" and not u.setup]
    if len(names) < 2 or not zeros or experiment.quantity != "position":
        return None
    more: list[Unknown] = []
    columns: list[Floats] = []
    for name in names:
        here = np.array(experiment.setup) == name
        for i in zeros:
            u = s.unknowns[i]
            more.append(replace(u, name=f"{u.name} in set-up {name}", setup=str(name)))
            columns.append(np.where(here[:, None], s.columns[..., i], 0.0))
    at = None if s.at is None else np.append(s.at, np.zeros(len(more)))
    stack = np.concatenate([s.columns, np.stack(columns, axis=-1)], axis=-1)
    return replace(s, unknowns=(*s.unknowns, *more), columns=stack, at=at)

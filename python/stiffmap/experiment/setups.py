"""Instruments and targets: which row belongs to which."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.experiment.experiment import Experiment, Floats, Integers

SEEN = "seen_target_"
"""Names of the points on the tool that stand for targets, with their number behind."""


def setups_of(e: Experiment) -> tuple[Integers, list[str]]:
    """(n,) number of each row's instrument in its set-up, and their names."""
    return _labelled(e, e.setup, e.instrument)


def targets_of(e: Experiment) -> tuple[Integers, list[str]]:
    """(n,) number of each row's target, and their names; one per set-up where none is named."""
    return _labelled(e, e.target or e.setup)


def members(number: Integers) -> Floats:
    """(k, n) 1 where a row has one of the numbers (n,), rising."""
    return np.equal.outer(np.unique(number), number).astype(float)


def target_positions(experiment: Experiment) -> Floats:
    """(n, 3) m, base axes: where the targets were commanded."""
    out = experiment.position.copy()
    if experiment.rotation is None or not experiment.points:  # the lever is the same in all rows: a shift
        return out
    shifts = {name: shift for name, _, shift in experiment.registration}
    number, names = targets_of(experiment)
    seen = np.array([SEEN in point for point in experiment.points])
    for k, name in enumerate(names):
        if (shift := shifts.get(f"target {name}")) is not None:
            here = seen & (number == k)
            out[here] += experiment.rotation[here] @ shift
    return out


def standing(e: Experiment, shown: Floats) -> Experiment:
    """The rows with the tool's poses where a machine that shows `shown` (n, c) m, rad stands."""
    turn = Rotation.from_rotvec(np.nan_to_num(shown[:, 3:6])).as_matrix()
    out = replace(e, rotation=None if e.rotation is None else turn @ e.rotation)
    levers = target_positions(out) - out.position
    return replace(out, position=target_positions(e) + np.nan_to_num(shown[:, :3]) - levers)


def _labelled(e: Experiment, *words: tuple[str, ...]) -> tuple[Integers, list[str]]:
    told = [w for w in words if w] or [("",) * len(e)]
    joined = [" ".join(parts) for parts in zip(*told, strict=True)]
    names, number = np.unique(joined, return_inverse=True)
    return number.reshape(-1).astype(np.intp), [str(n) or "1" for n in names]

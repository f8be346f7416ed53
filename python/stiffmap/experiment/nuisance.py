"""What the experiment leaves open and nobody wants to know: frames and zeros, linear columns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats


def nuisance_columns(experiment: Experiment, base: Floats) -> Floats:
    """(n, 6, q) changes of the readings; `base` (n, 6) is the declared machine's prediction."""
    columns = [c for part in (_zeros, _frames) for c in part(experiment, base)]
    return np.stack(columns, axis=-1) if columns else np.zeros((len(experiment), 6, 0))


def _zeros(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """An unknown zero per pose and axis."""
    if experiment.quantity == "deflection" and experiment.unloaded == "unknown":
        for group in np.unique(experiment.groups):
            yield from _per_axis((experiment.groups == group).astype(float), experiment)


def _frames(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """The instrument's frame, one per set-up."""
    if experiment.frame == "known":
        return
    setups = np.unique(experiment.setup or ("",) * len(experiment), return_inverse=True)[1]
    for setup in np.unique(setups):
        here = (setups == setup).astype(float)
        if experiment.quantity == "position":
            yield from _per_axis(here, experiment)
        if experiment.frame == "unknown":
            yield from _turns(here, experiment, base)


def _turns(here: Floats, experiment: Experiment, base: Floats) -> Iterator[Floats]:
    position = experiment.quantity == "position"
    for axis in np.eye(3):
        linear = np.cross(axis, experiment.position if position else base[:, :3])
        angular = np.broadcast_to(axis, linear.shape) if position else np.cross(axis, base[:, 3:])
        yield here[:, None] * np.hstack([linear, angular])


def _per_axis(pattern: Floats, experiment: Experiment) -> Iterator[Floats]:
    for axis in np.flatnonzero(experiment.axis_read):
        column = np.zeros((len(experiment), 6))
        column[:, axis] = pattern
        yield column

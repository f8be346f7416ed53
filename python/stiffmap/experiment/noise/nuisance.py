"""What the experiment leaves open and nobody wants to know: frames and zeros, linear columns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.readings import kind_of
from stiffmap.experiment.setups import setups_of, targets_of


def nuisance_columns(experiment: Experiment, base: Floats) -> Floats:
    """(n, c, q) changes of the readings; `base` (n, c) is the declared machine's prediction."""
    columns = [c for part in (_zeros, _frames, _tools, _readings) for c in part(experiment, base)]
    return np.stack(columns, axis=-1) if columns else np.zeros((*experiment.reading.shape, 0))


def _zeros(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """An unknown zero per pose and channel."""
    if experiment.quantity == "deflection" and experiment.unloaded == "unknown":
        for group in np.unique(experiment.groups):
            yield from _per_axis((experiment.groups == group).astype(float), experiment)


def _setups(experiment: Experiment) -> Iterator[Floats]:
    """(n,) 1 where a row belongs to the set-up of an instrument."""
    label = setups_of(experiment)[0]
    yield from ((label == s).astype(float) for s in np.unique(label))


def _frames(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """The instrument's frame, one per set-up; distances and joints do not know it."""
    if experiment.frame == "known":
        return
    for here in _setups(experiment):
        if experiment.quantity == "position":
            yield from _per_axis(here, experiment, 6)
        if experiment.frame == "unknown":
            yield from _turns(here, experiment, base)


def _turns(here: Floats, experiment: Experiment, base: Floats) -> Iterator[Floats]:
    position = experiment.quantity == "position"
    for axis in np.eye(3):
        linear = np.cross(axis, experiment.position if position else base[:, :3])
        angular = np.broadcast_to(axis, linear.shape) if position else np.cross(axis, base[:, 3:6])
        yield _wide(experiment, here[:, None] * np.hstack([linear, angular]))


def _tools(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """Where targets sit on the tool: off by a vector that turns with the tool, and turned if that is unknown."""
    if experiment.tool == "known":
        return
    label = targets_of(experiment)[0]
    for here in ((label == t).astype(float) for t in np.unique(label)):
        for k in range(3):
            arm = _tool_axis(experiment.rotation, len(experiment), k)
            moved = np.cross(np.nan_to_num(base[:, 3:6]), arm)
            linear = moved + arm if experiment.quantity == "position" else moved
            column = _wide(experiment, np.hstack([linear, np.zeros_like(linear)]))
            for i, kind in ((i, kind_of(c)) for i, c in enumerate(experiment.channels)):
                if kind and kind.tool_offset:
                    column[:, i] = kind.tool_offset(experiment, arm, k)
            yield here[:, None] * column
            if experiment.tool == "unknown" and experiment.quantity == "position":
                yield here[:, None] * _wide(experiment, np.hstack([np.zeros_like(arm), arm]))


def _readings(experiment: Experiment, base: Floats) -> Iterator[Floats]:
    """What nobody knows of a kind of reading, as the height of a surface."""
    for i, kind in ((i, kind_of(c)) for i, c in enumerate(experiment.channels)):
        for change in kind.nuisance(experiment) if kind and kind.nuisance else ():
            column = np.zeros_like(experiment.reading)
            column[:, i] = change
            yield column


def _tool_axis(rotation: Floats | None, n: int, k: int) -> Floats:
    return np.tile(np.eye(3)[k], (n, 1)) if rotation is None else np.asarray(rotation[:, :, k])


def _wide(experiment: Experiment, axes: Floats) -> Floats:
    """(n, c) with zero for what is not an axis."""
    return np.hstack([axes, np.zeros((len(experiment), len(experiment.extra)))])


def _per_axis(pattern: Floats, experiment: Experiment, most: int | None = None) -> Iterator[Floats]:
    for axis in np.flatnonzero(experiment.axis_read[:most]):
        column = np.zeros_like(experiment.reading)
        column[:, axis] = pattern
        yield column

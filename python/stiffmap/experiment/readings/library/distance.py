"""Distance between the point at two commanded poses, as a ball-bar or a tracker reads it."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.readings.types import ReadingKind, Seen


def change(here: Seen, there: Seen | None) -> Floats:
    """(n,) m: length between the two places less that between the two commands."""
    assert there is not None
    apart = there.position - here.position
    length = np.linalg.norm(apart + there.motion[:, :3] - here.motion[:, :3], axis=1)
    return np.asarray(length - np.linalg.norm(apart, axis=1))


def commanded(e: Experiment) -> Floats:
    """(n,) m."""
    assert e.other is not None
    return np.asarray(np.linalg.norm(e.other - e.position, axis=1))


def tool_offset(e: Experiment, arm: Floats, k: int) -> Floats:
    """(n,) change of a distance per length of the target's offset: none where both poses turn alike."""
    assert e.other is not None
    apart = e.other - e.position
    way = apart / np.linalg.norm(apart, axis=1, keepdims=True)
    turned = e.other_rotation
    there = np.tile(np.eye(3)[k], (len(e), 1)) if turned is None else turned[:, :, k]
    return np.asarray(np.nan_to_num(np.sum(way * (there - arm), axis=1)))


READING = ReadingKind(
    name="dd",
    unit="m",
    title="a distance between two poses",
    change=change,
    pair=True,
    quantities=("position",),
    absolute="distance",
    commanded=commanded,
    tool_offset=tool_offset,
)

"""Distance between the point at two commanded poses, as a ball-bar or a tracker reads it, and height of the point along the
normal of a surface, as a probe or a dial gauge reads it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.readings.types import ReadingKind, Seen
from stiffmap.experiment.setups import members, setups_of


def distance(here: Seen, there: Seen | None) -> Floats:
    """(n,) m: length between the two places less that between the two commands."""
    assert there is not None
    apart = there.position - here.position
    length = np.linalg.norm(apart + there.motion[:, :3] - here.motion[:, :3], axis=1)
    return np.asarray(length - np.linalg.norm(apart, axis=1))


def distance_commanded(e: Experiment) -> Floats:
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


DISTANCE = ReadingKind(
    name="dd",
    unit="m",
    title="a distance between two poses",
    change=distance,
    pair=True,
    quantities=("position",),
    absolute="distance",
    commanded=distance_commanded,
    tool_offset=tool_offset,
)


def height(here: Seen, there: Seen | None) -> Floats:
    """(n,) m along the normal."""
    return np.asarray(here.motion[:, :3] @ np.array(here.plan.normal))


def height_commanded(e: Experiment) -> Floats:
    """(n,) m."""
    return np.asarray(e.position @ np.array(e.normal))


def surface(e: Experiment) -> Iterator[Floats]:
    """Height and tilts of the surface, one of each per set-up."""
    if e.surface == "known":
        return
    across = np.linalg.svd(np.array([e.normal]))[2][1:]
    shapes = [np.ones(len(e)), *(e.position @ a for a in across if e.surface == "unknown")]
    yield from (here * shape for here in members(setups_of(e)[0]) for shape in shapes)


HEIGHT = ReadingKind(
    name="hh",
    unit="m",
    title="a height against a surface",
    change=height,
    quantities=("position",),
    absolute="contact",
    commanded=height_commanded,
    nuisance=surface,
)

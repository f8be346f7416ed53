"""Height of the point along the normal of a surface, as a probe or a dial gauge reads it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.readings.types import ReadingKind, Seen
from stiffmap.experiment.setups import members, setups_of


def change(here: Seen, there: Seen | None) -> Floats:
    """(n,) m along the normal."""
    return np.asarray(here.motion[:, :3] @ np.array(here.plan.normal))


def commanded(e: Experiment) -> Floats:
    """(n,) m."""
    return np.asarray(e.position @ np.array(e.normal))


def nuisance(e: Experiment) -> Iterator[Floats]:
    """Height and tilts of the surface, one of each per set-up."""
    if e.surface == "known":
        return
    across = np.linalg.svd(np.array([e.normal]))[2][1:]
    shapes = [np.ones(len(e)), *(e.position @ a for a in across if e.surface == "unknown")]
    yield from (here * shape for here in members(setups_of(e)[0]) for shape in shapes)


READING = ReadingKind(
    name="hh",
    unit="m",
    title="a height against a surface",
    change=change,
    quantities=("position",),
    absolute="contact",
    commanded=commanded,
    nuisance=nuisance,
)

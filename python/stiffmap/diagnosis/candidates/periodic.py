"""Periodic errors of a drive: amplitude, period and phase, of which two are unknown without it.

To first order the reading changes by that of a zero offset times sin(2 pi (u - home)/period + phase),
u the commanded coordinate: for each period two columns, sine and cosine.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.description import AppliedEffect
from stiffmap.diagnosis.candidates.candidates import Candidate
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.predict import Predictor

KIND = "periodic_error"
SHORTEST = 2e-3
PER_WIDTH = 2.5  # periods tried per resolvable frequency


def is_periodic(candidate: Candidate) -> bool:
    """Whether the candidate has a period."""
    return candidate.kind == KIND


def periodic_variants(
    candidate: Candidate, predictor: Predictor, base: Floats
) -> Iterator[tuple[Floats, tuple[tuple[str, float], ...]]]:
    """(n, 6, 2) columns per `scale` of the amplitude, and the period, for every period worth trying."""
    scale = candidate.parameters[0].scale
    legs = candidate.legs or ("",)  # none: a drive before or behind the legs
    travel = {leg: coordinate(candidate, leg, predictor) for leg in legs}
    each = {leg: _offset(candidate, leg, predictor, base) * scale for leg in legs}
    if not max(float(np.nanmax(np.abs(c))) for c in each.values()) > 0.0:
        return
    reach = max(float(np.ptp(u)) for u in travel.values())
    for frequency in frequencies(reach, next(iter(travel.values()))):
        parts = [
            np.stack([each[g] * np.sin(w)[:, None], each[g] * np.cos(w)[:, None]], axis=-1)
            for g in legs
            for w in [2 * np.pi * frequency * travel[g]]
        ]
        yield np.asarray(sum(parts)), (("period", 1.0 / frequency),)


def frequencies(reach: float, travel: Floats) -> Floats:
    """From half a period in the travel up to what the number of poses can hold apart."""
    if reach <= 0.0:
        return np.zeros(0)
    highest = min(1.0 / SHORTEST, len(np.unique(np.round(travel, 9))) * 1.5 / reach)
    return np.arange(0.5 / reach, highest, 1.0 / (PER_WIDTH * reach))


def _offset(candidate: Candidate, leg: str, predictor: Predictor, base: Floats) -> Floats:
    """(n, 6) change of the readings per unit of a zero offset of one drive."""
    step = 1e-5
    term = AppliedEffect("zero_offset", candidate.element, (leg,) if leg else (), (("error", step),))
    return (predictor([term]) - base) / step


def coordinate(candidate: Candidate, leg: str, predictor: Predictor) -> Floats:
    """(n,) commanded coordinate of a drive from its home."""
    e = predictor.experiment
    names = predictor.machine.actuators
    found = coordinates_of(predictor.machine, e)
    mine = [n.split(".")[0] == leg if leg else "." not in n for n in names]
    i = next(k for k, n in enumerate(names) if mine[k] and n.split(".")[-1] == candidate.element)
    compiled = predictor.machine.compiled
    joint = compiled.names.joints[names[i]]
    return np.asarray(found[:, joint] - compiled.home_coordinates()[joint])

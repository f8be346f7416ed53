"""A cable of unknown anchor: to first order a force at its point, whatever the anchor.

Three predictions with a small force at the point give the readings' change for every anchor and free
length: force = stiffness·(distance - length) along the line, at the place where the machine stands.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from stiffmap.diagnosis.candidates.candidates import Candidate
from stiffmap.diagnosis.candidates.shapes import Shape
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.prediction.predict import Predictor

KIND = "external_spring"
SLACK = (0.0, 0.7)
"""Free length as a share of the distance to the middle of the plan."""
STEP = 10.0  # N


def is_cable(candidate: Candidate, experiment: Experiment) -> bool:
    """Whether the candidate is a cable at the point where forces act."""
    return candidate.kind == KIND and candidate.element == experiment.load_point


def cable_variants(
    candidate: Candidate, predictor: Predictor, base: Floats
) -> Iterator[tuple[Floats, Shape]]:
    """(n, 6, 1) column per `scale` of the stiffness, and free length and anchor."""
    e, scale = predictor.experiment, candidate.parameters[0].scale
    yields = compliance(predictor, base)
    for anchor, length in anchors(e.position):
        pull = _force(e.position + base[:, :3], anchor, length)
        if e.quantity == "deflection":
            pull = pull - _force(e.position, anchor, length)
        column = np.einsum("nij,nj->ni", yields, pull) * scale
        named = zip(("anchor_x", "anchor_y", "anchor_z"), anchor.tolist(), strict=True)
        yield column[..., None], (("length", length), *named)


def compliance(predictor: Predictor, base: Floats) -> Floats:
    """(n, 6, 3) change of the readings per N along x, y, z at the loaded point."""
    e = predictor.experiment
    out = []
    for axis in np.eye(6)[:3]:
        more = Predictor(
            predictor.machine, replace(e, wrench=e.wrench + STEP * axis), threads=predictor.threads
        )
        out.append((more() - base) / STEP)
    return np.stack(out, axis=-1)


def anchors(position: Floats) -> Iterator[tuple[Floats, float]]:
    """Faces and corners of a cube of twice the plan's extent, each with the free lengths."""
    low, high = position.min(axis=0), position.max(axis=0)
    reach = max(float((high - low).max()), 0.1)
    for way in product((-1.0, 0.0, 1.0), repeat=3):
        if sum(map(abs, way)) in (1.0, 3.0):
            away = np.array(way) * reach
            for share in SLACK:
                yield (low + high) / 2 + away, share * float(np.linalg.norm(away))


def _force(at: Floats, anchor: Floats, length: float) -> Floats:
    line = anchor - at
    distance = np.linalg.norm(line, axis=1, keepdims=True)
    return np.asarray((distance - length) * line / distance)

"""An instrument's frame that is not where it is believed to be."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Plan
from stiffmap.model.effects.library.geometry import AXES, rotation_of, translation_of
from stiffmap.model.effects.library.measurement import added, measured
from stiffmap.model.effects.types import EffectType, Parameter

PARAMETERS = (
    *(Parameter(a, "m", -1.0, 1.0, 0.0, 1e-4, f"shift of every reading along {a}") for a in AXES),
    *(
        Parameter(
            f"angle_{a}", "rad", -math.pi, math.pi, 0.0, 1e-4, f"turn of the instrument's frame about {a}"
        )
        for a in AXES
    ),
)


def offset(plan: Plan, term: AppliedEffect) -> Floats:
    """(n, 6) of a position: the instrument's frame is offset, and turned about the base origin."""
    if plan.quantity != "position":
        return np.zeros((len(plan.position), 6))
    parameters = dict(term.parameters)
    r, shift = rotation_of(parameters), translation_of(parameters, "")
    turn = np.broadcast_to(Rotation.from_matrix(r).as_rotvec(), plan.position.shape)
    return np.hstack([shift + plan.position @ (r - np.eye(3)).T, turn])


EFFECT = EffectType(
    **measured("frame_offset", "sensor", PARAMETERS),
    precedence=360,
    title="position and orientation of the instrument's frame",
    doc=(
        "The instrument's frame is not where it is believed: a measured position p reads as shift + "
        "Rx·Ry·Rz p, so that an error of position gains shift + (Rx·Ry·Rz - 1) p."
    ),
    frame="base axes",
    pivot="origin of the base",
    reading=added(offset),
    hidden=lambda plan: plan.frame != "known",
)

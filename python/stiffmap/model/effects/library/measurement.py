"""What the effects of a measurement share.

Load side: the wrench that acts is ``R G w``. Reading, ``deflection``: it is ``G Rᵀ u``, the sensor's axes being turned
by R; ``position``: instruments give coordinates, so gain and axes act on commanded position plus displacement and the
commanded position is subtracted again. R is Rx(angle_x)·Ry(angle_y)·Rz(angle_z) everywhere. They act on the six axes
of a pose; joints and distances are read by other instruments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Plan, Reading
from stiffmap.model.effects.library.geometry import AXES, components, rotations
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import Parameter

ANGLES: tuple[Parameter, ...] = rotations("rotation")["parameters"]


def gains(doc: str) -> tuple[Parameter, ...]:
    """``gain`` of all axes and ``gain_x`` … of single ones (they multiply)."""
    each = tuple(Parameter(f"gain_{a}", "1", 0.1, 10.0, 1.0, 0.01, f"{doc}, {a} axis alone") for a in AXES)
    return (Parameter("gain", "1", 0.1, 10.0, 1.0, 0.01, f"{doc}, all axes"), *each)


def turned(values: Floats, r: Floats) -> Floats:
    """(n, 6) with linear and angular part turned by r (3, 3)."""
    return np.hstack([values[:, :3] @ r.T, values[:, 3:] @ r.T])


def scaled(values: Floats, parameters: Mapping[str, float]) -> Floats:
    """(n, 6) times ``gain`` and ``gain_x`` … (linear and angular part alike)."""
    common = parameters.get("gain", 1.0)
    own = np.array([parameters.get(f"gain_{a}", 1.0) for a in AXES])
    return np.asarray(values * common * np.tile(own, 2))


def of_coordinates(change: Callable[[Floats, Mapping[str, float]], Floats]) -> Reading:
    """A change (n, 6) of what an instrument shows, as a reading: of coordinates where positions are read."""

    def reading(read: Floats, motion: Floats, plan: Plan, term: AppliedEffect) -> Floats:
        where = np.zeros((len(read), 6))
        if plan.quantity == "position":
            where[:, :3] = plan.position
        axes = change(read[:, :6] + where, dict(term.parameters)) - where
        return np.hstack([axes, read[:, 6:]])

    return reading


def added(part: Callable[[Plan, AppliedEffect], Floats]) -> Reading:
    """What is added (n, 6) to the six axes, as a reading."""

    def reading(read: Floats, motion: Floats, plan: Plan, term: AppliedEffect) -> Floats:
        return np.hstack([read[:, :6] + part(plan, term), read[:, 6:]])

    return reading


def measured(kind: str, element: str, parameters: tuple[Parameter, ...]) -> dict[str, Any]:
    """What kinds share that live in the measurement."""
    return {
        "kind": kind,
        "places": at(element),
        "apply": None,
        "moves": "nothing of the machine",
        "excludes": (kind,),
        **components(parameters),
    }

"""What the geometric errors share: three translations or three rotations as parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Joint, Pose
from stiffmap.model.effects.types import Parameter

AXES = "xyz"


def components(parameters: Iterable[Parameter]) -> dict[str, Any]:
    """``parameters`` and ``vector`` of an effect that has these parameters only."""
    known = tuple(parameters)
    return {"parameters": known, "vector": tuple(p.name for p in known)}


def translations(doc: str, prefix: str = "error_") -> dict[str, Any]:
    """`components` ``error_x``, ``error_y``, ``error_z`` (m)."""
    return components(Parameter(f"{prefix}{a}", "m", -0.1, 0.1, 0.0, 1e-4, f"{doc} along {a}") for a in AXES)


def rotations(doc: str) -> dict[str, Any]:
    """`components` ``angle_x``, ``angle_y``, ``angle_z`` (rad)."""
    return components(Parameter(f"angle_{a}", "rad", -0.1, 0.1, 0.0, 1e-4, f"{doc} about {a}") for a in AXES)


def translation_of(values: Mapping[str, float], prefix: str = "error_") -> NDArray[np.float64]:
    """(3,) m."""
    return np.array([values.get(f"{prefix}{a}", 0.0) for a in AXES])


def rotation_of(values: Mapping[str, float], share: float = 1.0) -> NDArray[np.float64]:
    """(3, 3) Rx·Ry·Rz: about x, then about the turned y, then about the twice turned z."""
    out = np.eye(3)
    for a, axis in zip(AXES, np.eye(3), strict=True):
        out = out @ rotation_about(axis, share * values.get(f"angle_{a}", 0.0))
    return out


def point(prefix: str, doc: str, reach: float = 100.0) -> tuple[Parameter, ...]:
    """``prefix_x``, ``prefix_y``, ``prefix_z`` (m) of a known point, at the origin where they are left out."""
    return tuple(
        Parameter(f"{prefix}_{a}", "m", -reach, reach, None, 0.1, f"{doc}, {a}", default=0.0, fitted=False)
        for a in AXES
    )


def about(pivot: NDArray[np.float64], rotation: NDArray[np.float64]) -> Pose:
    """The rotation about a pivot (3,) m."""
    return Pose.of(pivot - rotation @ pivot, rotation)


def home_position(joint: Joint) -> NDArray[np.float64]:
    """(3,) m, the frame behind the joint at home, in the frame before it."""
    slides = joint.kind == "prismatic"
    return np.array(joint.axes[0]) * joint.home[0] if slides else np.zeros(3)

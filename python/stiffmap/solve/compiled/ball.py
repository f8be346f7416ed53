"""Axes of universal and ball joints: chosen away from lock where any would do (docs/theory.md C8)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from stiffmap import _core
from stiffmap.common.errors import StiffmapError
from stiffmap.common.rotations import rotation_about
from stiffmap.model.description import Joint
from stiffmap.model.description.pose import IDENTITY

PARALLEL = 1e-3  # sine of the angle between axes that make no joint of this kind
WIDE = 0.9  # volume that three axes span at home; below it, a free ball joint gets others


def any_axes_do(e: Joint) -> bool:
    """A ball joint without spring, friction and limits: its axes only number its rotations."""
    return e.kind == "spherical" and e.free and e.friction is None and e.limits is None


@lru_cache(maxsize=4096)
def _at_home(axes: tuple[tuple[float, ...], ...], home: tuple[float, ...]) -> tuple[tuple[float, ...], float]:
    """Rotation of a ball joint at home, row by row, and the volume that its axes span there."""
    turn, at_home = np.eye(3), []
    for axis, angle in zip(np.array(axes), home, strict=True):
        at_home.append(turn @ axis)
        turn = turn @ rotation_about(axis, angle)
    return tuple(turn.ravel().tolist()), abs(float(np.linalg.det(np.array(at_home))))


@lru_cache(maxsize=4096)
def _parallel(axes: tuple[tuple[float, ...], ...]) -> int:
    """The first axis that is parallel to the next, -1: none."""
    for i in range(len(axes) - 1):
        if np.linalg.norm(np.cross(axes[i], axes[i + 1])) < PARALLEL:
            return i
    return -1


def _perpendicular(axes: tuple[tuple[float, ...], ...]) -> bool:
    """Whether neighbouring axes are: the core then numbers the joint anew wherever it comes near its lock."""
    return all(abs(np.dot(axes[i], axes[i + 1])) <= 1e-9 for i in range(len(axes) - 1))


def charted(e: Joint) -> tuple[Joint, _core.Pose | None]:
    """The joint with axes that do not lock at home, and the constant rotation before it (None: none).

    A free ball joint whose axes are far from perpendicular at home gets three that are. StiffmapError where axes that are meant (with a
    spring, friction or limits about them) lock at home, or where neighbouring axes are parallel.
    """
    if len(e.axes) < 2:
        return e, None
    if (i := _parallel(e.axes)) >= 0:
        raise StiffmapError(
            f"joint {e.name}: axes {i + 1} and {i + 2} of a {e.kind} joint must not be parallel, "
            f"got {e.axes[i]} and {e.axes[i + 1]}"
        )
    if e.kind != "spherical":
        return e, None
    turn, spread = _at_home(e.axes, e.home)
    if any_axes_do(e) and (spread < WIDE or not _perpendicular(e.axes)):
        flat = replace(e, axes=IDENTITY, home=(0.0, 0.0, 0.0))
        return flat, _core.Pose(np.zeros(3), np.array(turn).reshape(3, 3))
    if spread < PARALLEL:
        raise StiffmapError(
            f"joint {e.name}: the first and the last axis of this ball joint coincide at home (gimbal lock); "
            "its spring, friction or limits refer to these axes: choose axes that are perpendicular at home"
        )
    return e, None

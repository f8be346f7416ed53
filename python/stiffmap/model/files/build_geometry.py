"""Frames and vectors of a file to SI poses."""

from __future__ import annotations

import numpy as np

from stiffmap.common.rotations import rotation_about
from stiffmap.common.units import ANGLE, LENGTH, NONE, Dimension
from stiffmap.model.description.pose import IDENTITY, Pose, Rows, Vector, rows
from stiffmap.model.files.context import Context
from stiffmap.model.files.schema.base import Number
from stiffmap.model.files.schema.geometry import NAMED, FrameModel

ROTATION_TOLERANCE = 1e-6
EXACT = 1e-14  # such rows stay as written: saved files must load back equal


def build_vector(numbers: list[Number], dimension: Dimension, context: Context, name: str) -> Vector:
    """Three SI numbers; fields ``name.x`` ..."""
    x, y, z = (context.si(n, dimension, f"{name}.{a}") for n, a in zip(numbers, "xyz", strict=True))
    return (x, y, z)


def build_pose(frame: FrameModel | None, context: Context, prefix: str = "") -> Pose:
    """SI pose of a frame (identity where absent)."""
    if frame is None:
        return Pose()
    translation: Vector = (0.0, 0.0, 0.0)
    if frame.translation is not None:
        translation = build_vector(frame.translation, LENGTH, context, prefix + "translation")
    return Pose(translation, build_rotation(frame, context))


def build_rotation(frame: FrameModel, context: Context) -> Rows:
    """Rotation as rows; columns are the frame's axes seen from outside."""
    if frame.rotation is not None:
        return _checked_rows(frame.rotation, context.at("rotation"))
    if frame.axes is not None:
        matrix = np.array([NAMED[name] for name in frame.axes]).T
        if np.linalg.det(matrix) < 0.0:
            context.at("axes").fail(f"{''.join(frame.axes)} is left-handed; change one sign")
        return rows(matrix)
    matrix = np.eye(3)
    for i, turn in enumerate(frame.turns or []):
        angle = context.at("turns", i).si(turn.by, ANGLE)
        matrix = matrix @ rotation_about(np.array(turn.about), angle)
    return rows(matrix)


def _checked_rows(given: list[list[Number]], context: Context) -> Rows:
    matrix = np.array([[context.si(n, NONE) for n in row] for row in given])
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if error > ROTATION_TOLERANCE:
        context.fail(
            f"rows are not orthonormal (off by {error:.2g}, allowed {ROTATION_TOLERANCE:.0g}); "
            "write more digits, or use axes or turns"
        )
    if np.linalg.det(matrix) < 0.0:
        context.fail("the rotation is left-handed (determinant -1)")
    if error > EXACT:
        u, _, v = np.linalg.svd(matrix)  # the nearest rotation
        matrix = u @ v
    return rows(matrix) if np.any(matrix != np.eye(3)) else IDENTITY

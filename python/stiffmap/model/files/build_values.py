"""Frames, vectors and declared numbers of a file to SI."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.common.rotations import rotation_about
from stiffmap.common.units import ANGLE, LENGTH, NONE, Dimension
from stiffmap.model.description.numbers import PARTS, DeclaredNumber, numbers_of
from stiffmap.model.description.pose import IDENTITY, Pose, Rows, Vector, rows
from stiffmap.model.files.context import Context
from stiffmap.model.files.schema.base import NAMED, FileModel, FrameModel, Number

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


COORDINATE = DeclaredNumber("coordinate", coordinate=1)


def build_range(pair: list[Number], dimension: Dimension, context: Context, name: str) -> tuple[float, float]:
    """SI interval; raises `FileError` where it is empty."""
    low, high = (
        context.si(n, dimension, f"{name}.{w}") for n, w in zip(pair, PARTS["interval"], strict=True)
    )
    if low >= high:
        context.at(name).fail(f"the lower end {pair[0].value} is not below the upper end {pair[1].value}")
    return (low, high)


def build_numbers(
    model: FileModel, holder: type, angular: bool, context: Context, prefix: str = ""
) -> dict[str, Any]:
    """Values of the numbers that `holder` declares and the file gives, SI; raises `FileError` out of bounds."""
    out: dict[str, Any] = {}
    for n in numbers_of(holder):
        given: Any = model
        for key in n.key.split("."):
            given = getattr(given, key, None)
        if given is not None and n.shape != "axes":
            out[n.name] = build_number(n, given, angular, context, prefix)
    return out


def build_number(n: DeclaredNumber, given: Any, angular: bool, context: Context, prefix: str = "") -> Any:
    """SI value of one declared number, as a tuple where it has several parts."""
    if n.shape == "knots":
        units = (COORDINATE.dimension(angular), n.dimension(angular))
        return tuple(tuple(map(context.si, pair, units)) for pair in given)
    parts = given if isinstance(given, list) else [given]
    if n.shape == "interval":
        return build_range(parts, n.dimension(angular), context, n.key)
    values = tuple(
        context.si(part, n.dimension(n.turns(i, angular)), prefix + key)
        for i, (part, key) in enumerate(zip(parts, n.keys(parts), strict=True))
    )
    for part, value in zip(parts, values, strict=True):
        if not n.lower <= value <= n.upper:
            context.at(*n.key.split(".")).fail(f"expected {n.expected}; found {part.value}")
    return values if n.shape else values[0]

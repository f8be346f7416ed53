"""Axes, frames and boxes as a file writes them."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from stiffmap.model.files.schema.base import FileModel, Number, Pair, Vector3, describe

NAMED = {
    sign + letter: tuple((-1.0 if sign else 1.0) if i == k else 0.0 for i in range(3))
    for sign in ("", "-")
    for k, letter in enumerate("xyz")
}
_NUMBER = {"type": "number"}
_NAME = {"enum": sorted(NAMED)}
_VECTOR = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}


def read_axis(value: Any) -> tuple[float, float, float]:
    """Unit vector of ``x``, ``-y`` ... or of three numbers."""
    if isinstance(value, str) and value in NAMED:
        a, b, c = NAMED[value]
        return (a, b, c)
    numbers = value if isinstance(value, (list, tuple)) else ()
    if [isinstance(v, (int, float)) and not isinstance(v, bool) for v in numbers] != [True] * 3:
        raise ValueError(f"expected an axis: x, y, z, -x, -y, -z or three numbers; found {describe(value)}")
    length = sum(float(v) ** 2 for v in value) ** 0.5
    if not 0.0 < length < float("inf"):
        what = "a zero-length axis has no direction" if length == 0.0 else "the axis is not finite"
        raise ValueError(f"{what}: {value}")
    # a unit vector stays as written: saved files must load back equal
    scale = 1.0 if abs(length - 1.0) < 1e-14 else length
    x, y, z = (float(v) / scale for v in value)
    return (x, y, z)


def _read_permutation(value: object) -> list[str]:
    names = re.findall(r"-?[xyz]", "".join(map(str, value)) if isinstance(value, list) else str(value))
    if value not in (names, "".join(names)) or sorted(n[-1] for n in names) != ["x", "y", "z"]:
        raise ValueError(
            f"expected the base axes that are local x, y, z, such as yzx or z-yx; found {describe(value)}"
        )
    return names


Axis = Annotated[
    tuple[float, float, float],
    BeforeValidator(read_axis),
    WithJsonSchema({"anyOf": [_NAME, _VECTOR], "description": "x, -y ... or a vector (normalised)."}),
]
Permutation = Annotated[
    list[str],
    BeforeValidator(_read_permutation),
    WithJsonSchema(
        {
            "anyOf": [{"type": "string", "pattern": "^(-?[xyz]){3}$"}, {"type": "array", "items": _NAME}],
            "description": "yzx: local x, y, z are base y, z, x; signs are allowed: z-yx.",
        }
    ),
]


class Turn(FileModel):
    """A turn about one axis of the frame that the turns before it have reached."""

    about: Axis
    by: Annotated[Number, Field(description="Angle, in the file's angle unit.")]


class FrameModel(FileModel):
    """A frame seen from another one: translation, and at most one way to say the rotation."""

    translation: Vector3 | None = None
    rotation: Annotated[list[Vector3], Field(min_length=3, max_length=3)] | None = None
    axes: Permutation | None = None
    turns: list[Turn] | None = None

    @model_validator(mode="after")
    def _one_rotation(self) -> FrameModel:
        given = [k for k in ("rotation", "axes", "turns") if getattr(self, k) is not None]
        if len(given) > 1:
            raise ValueError(f"give only one of {', '.join(given)}")
        return self


class HomeModel(FrameModel):
    """TCP pose of the home configuration. With ``solve`` the joints' home coordinates are a first guess,
    and `stiffmap check` prints those that have been found."""

    solve: bool = False


class BoxModel(FileModel):
    """Axis-aligned box of TCP positions; an axis that is not commanded may be left out: the box is flat there."""

    x: Pair | None = None
    y: Pair | None = None
    z: Pair | None = None

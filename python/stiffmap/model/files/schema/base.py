"""What every part of the file schema shares: refused unknown keys, names, numbers, axes and frames."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, PydanticKnownError

from stiffmap.common.broadcasting import names_of
from stiffmap.common.errors import suggestion
from stiffmap.model.description.machine import SOURCES


def describe(value: object) -> str:
    """A value as an error message shows it: its sort, and itself when short."""
    sorts = {dict: "a mapping", list: "a list", str: "text", bool: "true/false", type(None): "nothing"}
    sort = sorts.get(type(value), "a number")
    if value is None:
        return sort
    text = repr(value)
    return sort if len(text) > 40 else f"{sort} ({text})"


class FileModel(BaseModel):
    """A mapping in a file: unknown keys are errors that name the nearest known key."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    @classmethod
    def as_mapping(cls, data: Any) -> Any:
        """Another way to write the mapping, as the mapping."""
        return data

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys(cls, data: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(data, BaseModel):
            return handler(data)
        data = cls.as_mapping(data)
        known = _keys_of(cls)
        if not isinstance(data, dict):
            raise ValueError(f"expected a mapping with keys among {', '.join(known)}; found {describe(data)}")
        unknown = [key for key in data if key not in known]
        if not unknown:
            return handler(data)
        errors = [ValueError(unknown_key(key, known)) for key in unknown]
        problems = [
            InitErrorDetails(type="value_error", loc=(), input=data, ctx={"error": e}) for e in errors
        ]
        try:
            handler({key: value for key, value in data.items() if key in known})
        except ValidationError as error:
            # what is missing at this level may be the key that is not spelled right
            inside = [e for e in error.errors(include_url=False) if e["loc"] and e["type"] != "missing"]
            problems += [_once_more(e) for e in inside]
        raise ValidationError.from_exception_data(cls.__name__, problems)


@cache
def _keys_of(model: type[FileModel]) -> list[str]:
    """Keys of a mapping, what is said of its numbers last."""
    said = Noted.model_fields if issubclass(model, Noted) else {}
    fields = sorted(model.model_fields.items(), key=lambda item: item[0] in said)
    return [f.alias or name for name, f in fields]


def unknown_key(key: object, known: Sequence[str]) -> str:
    """That a mapping cannot have this key, and which it can."""
    comma = " (decimals stand behind a point: 0.5)" if str(key)[:1].isdigit() else ""
    return f"unknown key '{key}'{comma or suggestion(str(key), known)}; known keys: {', '.join(known)}"


def _once_more(error: Any) -> InitErrorDetails:
    """A problem that has been found, to be raised with others."""
    sort: str | PydanticCustomError = error["type"]
    context = error.get("ctx", {})
    try:
        PydanticKnownError(error["type"], context)
    except (KeyError, TypeError):
        sort = PydanticCustomError(error["type"], "{message}", {**context, "message": error["msg"]})
    return InitErrorDetails(type=sort, loc=error["loc"], input=error["input"], ctx=context)


def _as_name(value: Any) -> Any:
    # leg "1" reads as a number in YAML
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Name = Annotated[
    str,
    BeforeValidator(_as_name, json_schema_input_type=str | int),
    Field(pattern=r"^[A-Za-z0-9_\-]+$", description="Letters, digits, '_' and '-'."),
]


EachOnce = AfterValidator(lambda names: list(names_of(names, "list")))
Source = Annotated[
    Literal[SOURCES],  # type: ignore[valid-type]
    Field(description="Where numbers come from: reports say how much of an answer rests on those assumed."),
]


class Noted(FileModel):
    """A mapping that may say where its numbers come from, and more in a note."""

    source: Source | None = None
    note: str = ""


class Number(FileModel):
    """A number, or ``{value: 775, u: 0.05, source: measured, note: "..."}`` with its standard uncertainty ``u``
    (same unit), where it comes from (assumed, measured, computed or catalogue) and a note."""

    value: Annotated[float, Field(allow_inf_nan=False)]
    u: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    source: Source | None = None
    note: str = ""

    @classmethod
    def as_mapping(cls, data: Any) -> Any:
        """A plain number as its value."""
        if isinstance(data, dict):
            return data
        if isinstance(data, bool) or not isinstance(data, (int, float)):
            raise ValueError(f"expected a number; found {describe(data)}")
        return {"value": float(data)}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": "number"}, handler(core_schema)]}


Numbers = list[Number]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]


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

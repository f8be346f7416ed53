"""What every part of the file schema shares: refused unknown keys, names, numbers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, PydanticKnownError

from stiffmap.common.errors import suggestion
from stiffmap.model.description.sources import SOURCES


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
    return f"unknown key '{key}'{suggestion(str(key), known)}; known keys: {', '.join(known)}"


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

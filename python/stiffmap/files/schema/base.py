"""What every part of the file schema shares: refused unknown keys, names, numbers."""

from __future__ import annotations

import difflib
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError


def describe(value: object) -> str:
    """A value as an error message shows it: its sort, and itself when short."""
    sorts = {dict: "a mapping", list: "a list", str: "text", bool: "true/false", type(None): "nothing"}
    sort = sorts.get(type(value), "a number")
    if value is None:
        return sort
    text = repr(value)
    return sort if len(text) > 40 else f"{sort} ({text})"


def suggestion(word: str, known: list[str]) -> str:
    """`` (did you mean 'length'?)`` or nothing."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f" (did you mean '{near[0]}'?)" if near else ""


class FileModel(BaseModel):
    """A mapping in a file: unknown keys are errors that name the nearest known key."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, BaseModel):
            return data
        known = list(cls.model_fields)
        if not isinstance(data, dict):
            raise PydanticCustomError(
                "mapping_expected",
                "expected a mapping with keys among {known}; found {found}",
                {"known": ", ".join(known), "found": describe(data)},
            )
        for key in data:
            if key not in known:
                raise PydanticCustomError(
                    "unknown_key",
                    "unknown key '{key}'{near}; known keys: {known}",
                    {"key": key, "near": suggestion(str(key), known), "known": ", ".join(known)},
                )
        return data


def _as_name(value: Any) -> Any:
    # leg "1" reads as a number in YAML
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Name = Annotated[
    str,
    BeforeValidator(_as_name, json_schema_input_type=str | int),
    Field(pattern=r"^[A-Za-z0-9_\-]+$", description="Letters, digits, '_' and '-'."),
]


class Number(FileModel):
    """A number, or ``{value: 775, u: 0.05, note: "..."}`` with its standard uncertainty ``u``
    (same unit) and a note that says where it comes from."""

    value: Annotated[float, Field(allow_inf_nan=False)]
    u: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    note: str = ""

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, data: Any) -> Any:
        if isinstance(data, (dict, BaseModel)):
            return data
        if isinstance(data, bool) or not isinstance(data, (int, float)):
            raise PydanticCustomError(
                "number_expected", "expected a number; found {found}", {"found": describe(data)}
            )
        return {"value": float(data)}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": "number"}, handler(core_schema)]}


Numbers = list[Number]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]

"""Validation errors stated in one sentence: file, line, key, what was expected and what was found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from stiffmap.common.errors import FileError, suggestion, together
from stiffmap.common.yaml_text import Document, KeyPath
from stiffmap.model.files.schema.base import describe, unknown_key
from stiffmap.model.files.schema.elements import SORTS

M = TypeVar("M", bound=BaseModel)


def validated(model: type[M], document: Document, file: str, expected: str) -> M:
    """A file's content against a schema; raises `FileError` with every problem.

    expected
        What such a file is: ``a motion file is a mapping with name and line, circle or points``.
    """
    if not isinstance(document.data, dict):
        raise FileError(f"{expected}; found {describe(document.data)}", file=file)
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        found = _telling(error.errors(include_url=False), document)
        raise together([_one(e, document, file) for e in found]) from error


def _telling(errors: list[Any], document: Document) -> list[Any]:
    """Without those of a wrong sort where a value may have another form, in which something else is wrong with it."""
    sorts = [e["type"].endswith("_type") for e in errors]
    paths = [_path(e["loc"], document.data, False) for e in errors]
    told = {p[:i] for p, sort in zip(paths, sorts, strict=True) for i in range(1, len(p) + (not sort))}
    return [e for e, p, sort in zip(errors, paths, sorts, strict=True) if not (sort and p in told)]


def _one(error: Any, document: Document, file: str) -> FileError:
    missing = error["type"] == "missing"
    path = _path(error["loc"], document.data, missing)
    if missing:
        path, message = path[:-1], f"missing key '{path[-1]}'"
    else:
        message = _message(error)
    return FileError(
        message, file=file, line=document.line(path) or (1 if document.lines else None), key=key_text(path)
    )


def in_words(error: ValidationError, known: Sequence[str]) -> str:
    """The first problem of data that are in no file and may have these keys, behind its key."""
    first = error.errors(include_url=False)[0]
    if first["type"] == "unexpected_keyword_argument":
        return unknown_key(first["loc"][0], known)
    return f"{key_text(first['loc'])}: {'missing' if first['type'] == 'missing' else _message(first)}"


def key_text(path: KeyPath) -> str:
    """``legs.x.elements[2].axis``."""
    text = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in path)
    return text.removeprefix(".")


def _path(loc: tuple[object, ...], data: object, missing: bool) -> KeyPath:
    """Location in the *file*: without the schema's own steps (union tags, forms of a matrix)."""
    path: list[str | int] = []
    for i, step in enumerate(loc):
        last = i == len(loc) - 1
        if isinstance(data, dict):
            # an element's tag comes before its keys, and its name stands under a key of the same name
            if step in SORTS and not last and "command_errors" not in path:
                continue
            if str(step) in data or (last and missing):
                path.append(str(step))
                data = data.get(str(step))
        elif isinstance(data, list) and isinstance(step, int) and step < len(data):
            path.append(step)
            data = data[step]
    return tuple(path)


def _message(error: Any) -> str:
    kind, found, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "finite_number":
        return f"expected a finite number; found {found}"
    if kind == "literal_error":
        choices = str(context["expected"]).replace(" or ", ",").split(",")
        near = suggestion(str(found), [choice.strip(" '") for choice in choices])
        return f"expected {context['expected']}; found {describe(found)}{near}"
    if kind == "string_pattern_mismatch":
        return f"a name has letters, digits, '_' and '-' only; found {describe(found)}"
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        return f"expected {wanted} entries; found {context['actual_length']}"
    if kind.endswith("_type"):
        sort = kind.removesuffix("_type").replace("tuple", "list")
        sorts = {"list": "a list", "dict": "a mapping", "string": "text", "bool": "true or false"}
        return f"expected {sorts.get(sort, 'a number')}; found {describe(found)}"
    if kind.startswith(("greater_than", "less_than")):
        return f"{error['msg'].replace('Input should be', 'expected a number')}; found {describe(found)}"
    return str(context["error"] if kind == "value_error" else error["msg"])

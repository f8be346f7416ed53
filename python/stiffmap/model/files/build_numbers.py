"""The numbers that an element declares, from a file to SI."""

from __future__ import annotations

from typing import Any

from stiffmap.common.units import Dimension
from stiffmap.model.description.numbers import PARTS, DeclaredNumber, numbers_of
from stiffmap.model.files.context import Context
from stiffmap.model.files.schema.base import FileModel, Number

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
            context.at(*n.key.split(".")).fail(f"expected {_bounds(n)}; found {part.value}")
    return values if n.shape else values[0]


def _bounds(n: DeclaredNumber) -> str:
    if n.upper == float("inf"):
        return "a number that is not negative" if n.lower == 0.0 else f"{n.lower:g} or more (SI)"
    return f"{n.lower:g} to {n.upper:g} (SI)"

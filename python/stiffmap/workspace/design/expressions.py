"""Arithmetic in design files: numbers, variables, + - * / **, sqrt, pi; nothing else runs."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache

from stiffmap.common.errors import StiffmapError

_BINARY: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def evaluate(text: str | float | int, names: Mapping[str, float]) -> float:
    """Value of an expression; StiffmapError for an unknown name or anything that is not arithmetic."""
    if isinstance(text, int | float):
        return float(text)
    try:
        return float(_value(_parsed(text), names))
    except (SyntaxError, TypeError, ArithmeticError, ValueError) as error:
        if isinstance(error, StiffmapError):
            raise
        raise StiffmapError(f"cannot evaluate '{text}': {error}") from None


@lru_cache(maxsize=4096)
def _parsed(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _value(node: ast.expr, names: Mapping[str, float]) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name):
        if node.id == "pi":
            return math.pi
        if node.id not in names:
            raise StiffmapError(f"unknown name '{node.id}'; known: {', '.join(sorted(names))}, pi, sqrt")
        return names[node.id]
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        return float(_BINARY[type(node.op)](_value(node.left, names), _value(node.right, names)))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_value(node.operand, names)
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "sqrt"
        and len(node.args) == 1
        and not node.keywords
    ):
        return math.sqrt(_value(node.args[0], names))
    raise StiffmapError(f"not arithmetic: {ast.unparse(node)}")

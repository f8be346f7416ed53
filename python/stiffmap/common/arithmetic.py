"""Arithmetic in files: numbers, names, + - * / **, pi, and the functions that the reader allows; nothing else runs."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache

from stiffmap.common.errors import StiffmapError

Functions = Mapping[str, Callable[..., float]]
SQRT: Functions = {"sqrt": math.sqrt}
_BINARY: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: operator.pow,
}  # fmt: skip
_SUMS = (ast.Constant, ast.BinOp, ast.UnaryOp, ast.USub, ast.Add, ast.Sub, ast.Mult, ast.Div)


def evaluate(text: str | float | int, names: Mapping[str, float], functions: Functions = SQRT) -> float:
    """Value of an expression; StiffmapError for an unknown name or anything that is not arithmetic."""
    if isinstance(text, int | float):
        return float(text)
    try:
        return float(_value(_parsed(text), names, functions))
    except (SyntaxError, TypeError, ArithmeticError, ValueError) as error:
        if isinstance(error, StiffmapError):
            raise
        raise StiffmapError(f"cannot evaluate '{text}': {error}") from None


def sum_of_numbers(text: str) -> float:
    """The value of sums, products and quotients of numbers; SyntaxError for anything else."""
    node = ast.parse(text.strip(), mode="eval").body
    for n in ast.walk(node):
        if not isinstance(n, _SUMS) or (isinstance(n, ast.Constant) and type(n.value) not in (int, float)):
            raise SyntaxError(text)
    return _value(node, {}, {})


@lru_cache(maxsize=4096)
def _parsed(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def _value(node: ast.expr, names: Mapping[str, float], functions: Functions) -> float:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name):
            if name not in names:
                known = ", ".join([*sorted(names), "pi", *functions])
                raise StiffmapError(f"unknown name '{name}'; known: {known}")
            return names[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return float(_BINARY[type(op)](_value(left, names, functions), _value(right, names, functions)))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, names, functions)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in functions:
            return float(functions[name](*(_value(a, names, functions) for a in args)))
    raise StiffmapError(f"not arithmetic: {ast.unparse(node)}")

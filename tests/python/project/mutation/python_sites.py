"""Mutants of the Python package: its rooms that compute, not those that draw, write sentences or ask the user."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from .mutant import Mutant, line_of

SILENT = {"cli", "plot", "report", "paper", "spreadsheet", "machines"}
WORDS = {
    "wording",
    "sentences",
    "describe",
    "page",
    "pages",
    "pictures",
    "html",
    "advice",
    "findings",
    "progress",
}
NEGATED = {
    ast.Lt: ">=",
    ast.Gt: "<=",
    ast.LtE: ">",
    ast.GtE: "<",
    ast.Eq: "!=",
    ast.NotEq: "==",
}
TWINS = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "sin": "cos",
    "cos": "sin",
    "argmin": "argmax",
    "argmax": "argmin",
}
#: Calls whose first two arguments are alike, or whose other order is no arithmetic.
SYMMETRIC = {
    "min",
    "max",
    "minimum",
    "maximum",
    "hypot",
    "isinstance",
    "zip",
    "getattr",
    "hasattr",
    "replace",
}
TEXT = (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp, ast.Dict, ast.Set)


def mutants_of(root: Path) -> Iterator[Mutant]:
    """Every mutant of the package."""
    package = root / "python/stiffmap"
    for path in sorted(package.rglob("*.py")):
        rooms = path.relative_to(package).with_suffix("").parts
        if not SILENT & set(rooms) and not WORDS & set(rooms):
            yield from sites(path.read_text(encoding="utf-8"), path.relative_to(root).as_posix())


def sites(source: str, file: str) -> Iterator[Mutant]:
    """Every mutant of one source."""
    starts = [0]
    for row in source.encode().split(b"\n"):
        starts.append(starts[-1] + len(row) + 1)
    raw = source.encode()

    def place(line: int, column: int) -> int:
        return len(raw[: starts[line - 1] + column].decode())

    def of(node: ast.expr) -> str:
        return source[place(node.lineno, node.col_offset) : end(node)]

    def end(node: ast.expr) -> int:
        return place(node.end_lineno or 0, node.end_col_offset or 0)

    for node in computing(ast.parse(source)):
        for kind, text in changes(node, of):
            start = place(node.lineno, node.col_offset)
            line, before = line_of(source, start)
            yield Mutant(file, line, start, end(node), kind, text, before)


def computing(tree: ast.AST) -> Iterator[ast.expr]:
    """Expressions but those of errors raised, texts, annotations and slices."""
    for child in ast.iter_child_nodes(tree):
        if isinstance(child, ast.Raise | ast.JoinedStr | ast.arg | ast.Slice | ast.Assert):
            continue
        if isinstance(child, ast.FunctionDef):
            if child.name in {"__repr__", "__str__", "__hash__"}:
                continue
            yield from computing(ast.Module(child.body, []))
            yield from computing(ast.Module([ast.Expr(d) for d in child.args.defaults], []))
            continue
        if (
            isinstance(child, ast.If)
            and isinstance(child.test, ast.Name)
            and child.test.id == "TYPE_CHECKING"
        ):
            continue
        if isinstance(child, ast.If) and all(isinstance(part, ast.Raise) for part in child.body):
            continue  # what is refused: the tests of bad input judge it
        if isinstance(child, ast.AnnAssign):
            if child.value is not None:
                yield from computing(ast.Module([ast.Expr(child.value)], []))
            continue
        if isinstance(child, ast.Call) and isinstance(child.func, ast.Name) and "Error" in child.func.id:
            continue
        if isinstance(child, ast.expr):
            yield child
        yield from computing(child)


def changes(node: ast.expr, of) -> Iterator[tuple[str, str]]:
    """(kind, text) of every change to one node."""
    match node:
        case ast.BinOp(left, ast.Add() | ast.Sub() as op, right) if number(left) and number(right):
            a, b = wrapped(left, of), wrapped(right, of)
            yield "sign", f"({a} {'-' if isinstance(op, ast.Add) else '+'} {b})"
            yield "dropped term", f"({a})"
        case ast.BinOp(left, ast.Mult() | ast.Div() as op, right) if number(left) and number(right):
            a, b = wrapped(left, of), wrapped(right, of)
            yield "factor", f"({a} {'/' if isinstance(op, ast.Mult) else '*'} {b})"
        case ast.UnaryOp(ast.USub(), operand) if not isinstance(operand, ast.Constant):
            yield "sign", f"({of(operand)})"
        case ast.Compare(left, [op], [right]) if type(op) in NEGATED and not text_of(left, right):
            yield "comparison", f"({of(left)} {NEGATED[type(op)]} {of(right)})"
        case ast.Constant(value) if isinstance(value, float) and value == value:
            small = 0 < abs(value) < 1e-3 or abs(value) > 1e3
            yield (
                "threshold" if small else "factor",
                repr(float(f"{value * 1e3 if small else 2 * value or 1.0:.9g}")),
            )
        case ast.Call(ast.Attribute(_, name) | ast.Name(name) as called, args):
            if name in TWINS and args:
                text = of(node)
                head = of(called)
                yield (
                    "comparison" if "m" in name else "sign",
                    head[: -len(name)] + TWINS[name] + text[len(head) :],
                )
            if len(args) > 1 and name not in SYMMETRIC and all(isinstance(a, ast.Name) for a in args[:2]):
                a, b = of(args[0]), of(args[1])
                inside = of(node)
                at = inside.index(a, len(of(called)))
                mid = inside.index(b, at + len(a))
                text = inside[:at] + b + inside[at + len(a) : mid] + a + inside[mid + len(b) :]
                if a != b:
                    yield "swapped arguments", text


def number(node: ast.expr) -> bool:
    """It may be one: neither text nor a list."""
    if isinstance(node, ast.BinOp):
        return number(node.left) and number(node.right)
    return not isinstance(node, TEXT) and not (isinstance(node, ast.Constant) and isinstance(node.value, str))


def text_of(*nodes: ast.expr) -> bool:
    """One of them is a text: a name is compared, not a number."""
    return any(isinstance(n, ast.Constant) and isinstance(n.value, str) for n in nodes)


def wrapped(node: ast.expr, of) -> str:
    """The text of an operand, in brackets where another operator would take it apart."""
    return f"({of(node)})" if isinstance(node, ast.BinOp | ast.UnaryOp | ast.IfExp) else of(node)

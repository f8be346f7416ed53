"""Mutants of the C++ core. All of a sample are compiled at once and chosen at run time (`tests/cpp/mutant.hpp`).

The changes are to tokens. `a + b * c` becomes `a + mutant::sign(n) * b * c`: the sign binds to the first factor of the
term, whatever the term is, and is one unless mutant n is chosen. clang-format keeps blanks around binary operators and
none inside template brackets, so that a blank tells them apart.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from .mutant import Mutant, line_of

NUMBER = r"(?<![\w.])(?:\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)(?![\w.])"
NAME = r"[A-Za-z_]\w*(?:\.\w+)*"
#: No arithmetic of a machine: messages, checks of arguments, sizes, templates.
NO_SUBSTANCE = re.compile(
    r"\b(require|throw|static_assert|template|operator|using|resize|reserve|string|sizeof|__builtin_\w+)\b|^\s*#"
)
SYMMETRIC = re.compile(r"\b(min|max|hypot|swap)$")


def mutants_of(root: Path) -> Iterator[Mutant]:
    """Every mutant of the core and of the kernels."""
    files = sorted((root / "cpp/src").rglob("*.[ch]pp")) + sorted((root / "cpp/kernels").glob("*.hpp"))
    for file in files:
        yield from sites(file.read_text(encoding="utf-8"), file.relative_to(root).as_posix())


def sites(source: str, file: str) -> Iterator[Mutant]:
    """Every mutant of one source; `@` in `text` is where the number of the mutant belongs."""
    code = bare(source)
    for kind, start, end, text in changes(code):
        if not NO_SUBSTANCE.search(line_of(code, start)[1]):
            yield Mutant(file, line_of(source, start)[0], start, end, kind, text, line_of(source, start)[1])


def bare(source: str) -> str:
    """The source with comments, strings and the headers of loops blanked, every other character at its place."""
    texts = r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])'"
    code = re.sub(texts, lambda m: re.sub(r"[^\n]", " ", m[0]), source, flags=re.DOTALL)
    for m in re.finditer(r"\bfor \(", code):
        depth, end = 1, m.end()
        while depth:
            depth += {"(": 1, ")": -1}.get(code[end], 0)
            end += 1
        code = code[: m.end()] + re.sub(r"[^\n]", " ", code[m.end() : end]) + code[end:]
    return code


def changes(code: str) -> Iterator[tuple[str, int, int, str]]:
    """(kind, start, end, text) of every change."""
    for m in re.finditer(r" [+-]\s+(?=\S)", code):
        yield "sign", m.end(), m.end(), "mutant::sign(@) * "
        yield "dropped term", m.end(), m.end(), "mutant::drop(@) * "
    for m in re.finditer(r"(?:[(,{?:=]\s*|\breturn )(-)(?=[A-Za-z(])", code):
        yield "sign", m.start(1), m.end(1), "mutant::minus(@) * "
    for m in re.finditer(r" ([*/])\s+(?=\S)", code):
        yield "factor", m.start(1), m.end(1), f"{m[1]} mutant::twice(@) {m[1]}"
    for m in re.finditer(r" [-+]= ([^;{}]*);", code):
        yield "sign", m.start(1), m.end(1), f"mutant::sign(@) * ({m[1]})"
        yield "dropped term", m.start(1), m.end(1), f"mutant::drop(@) * ({m[1]})"
    for m in re.finditer(r" (<=|>=|==|!=|<|>)\s+(?=\S)", code):
        yield "comparison", m.start(1), m.end(1), f"{m[1]} mutant::Compare{{@}} {m[1]}"
    for m in re.finditer(NUMBER, code):
        yield from literal(code, m)
    for m in re.finditer(r"std::(min|max)(?=\()", code):
        yield "comparison", m.start(), m.end(), f"mutant::{m[1]}imum<@>"
    for m in re.finditer(r"std::(sin|cos)(?=\()", code):
        yield "sign", m.start(), m.end(), "mutant::" + {"sin": "sine", "cos": "cosine"}[m[1]] + "<@>"
    for m in re.finditer(rf"(\b{NAME})\(({NAME}), ({NAME})(?=[,)])", code):
        if m[2] != m[3] and not SYMMETRIC.search(m[1]):
            text = f"mutant::either(@, {m[2]}, {m[3]}), mutant::either(@, {m[3]}, {m[2]})"
            yield "swapped arguments", m.start(2), m.end(3), text


def literal(code: str, m: re.Match[str]) -> Iterator[tuple[str, int, int, str]]:
    """A tolerance moves by 10^3, another number by 2."""
    value = float(m[0])
    kind = "threshold" if 0 < value < 1e-3 or value > 1e3 else "factor"
    other = f"{value * 1e3 if kind == 'threshold' else 2 * value or 1.0:.9g}"
    other += "" if "." in other or "e" in other else ".0"
    begin = code.rfind("\n", 0, m.start()) + 1
    named = re.match(r"\s*(?:inline |static )*constexpr double (\w+) = $", code[begin : m.start()])
    if named and code[m.end()] == ";":  # a constant of the file: a number that knows what it may become
        yield kind, begin, m.end(), f"constexpr mutant::Number {named[1]}{{@, {m[0]}, {other}}}"
    elif "constexpr" not in line_of(code, m.start())[1]:
        yield kind, m.start(), m.end(), f"mutant::number(@, {m[0]}, {other})"

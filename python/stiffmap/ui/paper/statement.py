"""The quantitative statements of the paper, our numbers, and verdicts; for people and for programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from enum import StrEnum
from functools import partial

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.padding import Padding
from rich.text import Text


class StatementVerdict(StrEnum):
    """How a statement fares."""

    AGREES = "agrees"
    DIFFERS = "differs"
    NOT_CHECKED = "cannot be checked"


@dataclass(frozen=True)
class Statement:
    """The paper's words next to our number."""

    section: str
    words: str
    ours: str
    """Our number in words, with its unit."""
    verdict: StatementVerdict
    because: str
    numbers: dict[str, float] = field(default_factory=dict)
    """The numbers behind `ours`, by name; the unit is part of the name."""
    printed: str = ""
    """The paper's number, with its unit; empty where it states none."""
    own_input: bool = False
    """Whether our number is one that our model was given from this very sentence or table: agreement proves nothing."""


of_section_5_3 = partial(Statement, "5.3")
"""A statement of §5.3, as most are."""


def rounds_to(ours: float, printed: str) -> bool:
    """Whether a number, rounded to the last digit that the paper prints, is what it prints.

    A whole number without a decimal point counts as given to its leading digits: "600" stands for
    550 … 650, "20" for 15 … 25.
    """
    value = Decimal(printed)
    digits = value.normalize().as_tuple()
    last = Decimal(1).scaleb(int(digits.exponent) if "." not in printed else int(value.as_tuple().exponent))
    return abs(Decimal(ours) - value) <= last / 2


def judge(holds: bool) -> StatementVerdict:
    """Agrees or differs."""
    return StatementVerdict.AGREES if holds else StatementVerdict.DIFFERS


def by_point(name: str, values: Mapping[str, float]) -> dict[str, float]:
    """Numbers behind a statement, one for each work point."""
    return {f"{name}_{point.replace(' ', '_')}": float(v) for point, v in values.items()}


COLOUR = dict(zip(StatementVerdict, ("green", "yellow", "dim"), strict=True))
HEAD = ("§", "the paper's words", "the paper's number", "our number", "verdict", "our own input", "because")
INDENT = 5


def as_rich(statements: Sequence[Statement]) -> RenderableType:
    """For a terminal of any width: a paragraph for each statement."""
    out: list[RenderableType] = []
    for s in statements:
        lines = [f"§{s.section} [bold]“{escape(s.words)}”[/]"]
        verdict = f"{s.verdict}{', but it is an input of our model' * s.own_input}"
        lines.append(f"paper: {escape(s.printed)}; ours: {escape(s.ours)}: [{COLOUR[s.verdict]}]{verdict}[/]")
        lines += [f"[dim]{escape(s.because)}[/]"] if s.because else []
        out += [Padding(Text.from_markup(t), (0, 0, 0, INDENT if i else 0)) for i, t in enumerate(lines)]
        out.append(Text(""))
    return Group(*out)


def as_markdown(statements: Sequence[Statement]) -> str:
    """For documents."""
    rows = [HEAD, ("---",) * len(HEAD), *(cells(s) for s in statements)]
    return "\n".join("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in rows) + "\n"


def as_table(statements: Sequence[Statement]) -> tuple[list[str], list[tuple[str, ...]]]:
    """Head and rows, for spreadsheets."""
    return ["section", *HEAD[1:]], [*map(cells, statements)]


def cells(s: Statement) -> tuple[str, ...]:
    """One row."""
    own = "yes" if s.own_input else "no"
    return s.section, s.words, s.printed, s.ours, str(s.verdict), own, s.because


def count(statements: Sequence[Statement]) -> dict[str, int]:
    """Number of statements per verdict."""
    return {str(v): sum(s.verdict == v for s in statements) for v in StatementVerdict}


def count_text(statements: Sequence[Statement]) -> str:
    """The numbers per verdict, and how many agreeing ones are inputs of our model."""
    own = sum(s.own_input and s.verdict is StatementVerdict.AGREES for s in statements)
    n = count(statements)
    return (
        f"{n['agrees']} agree ({own} of them are inputs of our model, {n['agrees'] - own} are results), "
        f"{n['differs']} differ, {n['cannot be checked']} cannot be checked"
    )

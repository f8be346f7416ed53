"""One quantitative statement of the paper, our number, and a verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from enum import StrEnum
from functools import partial


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

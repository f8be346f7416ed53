"""A mistake in how readings were taken or written, and how it would show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stiffmap.experiment.experiment import Experiment, Floats, Mask


@dataclass(frozen=True)
class Slip:
    """A mistake that explains readings better than any part of the machine does."""

    kind: str
    """``sign``, ``swap``, ``direction``, ``factor``, ``load`` or ``shift``."""
    seen: str
    """What the readings show, a clause."""
    check: str
    """What to check, a clause."""
    also: tuple[str, ...]
    """Other checks, of mistakes that these readings cannot distinguish from it."""
    left: float
    """Share of the squared misfit that stays once it is undone."""
    undone: bool
    """Whether everything else in the diagnosis is of readings with it undone."""
    evidence: tuple[str, ...] = ()
    """What linearity and reciprocity say, before and after."""
    factor: float | None = None
    """Reading over prediction, where it is one."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """How the declared machine would read with one mistake, and how that is undone."""

    kind: str
    seen: str
    check: str
    changes: int
    """How many things are wrong at once; of equally good ones the fewest win."""
    prediction: Floats
    """(n, c) m, rad."""
    undo: Callable[[Experiment], Experiment] | None
    keep: Mask | None = None
    """(n,) rows that it speaks of; None: all."""
    factor: float | None = None
    physical: bool = False
    """Whether a part of the machine may show the same: it is then named only where none does."""

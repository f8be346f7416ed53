"""Parts of the covariance of the readings that have an amplitude of their own."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import NUMBERS_SD, WIDEST

GAPS = ("field", "pose")
"""Kinds of parts that nobody can name."""
NOISE, ALL_NUMBERS = "noise", "declared numbers"


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the covariance with an amplitude: a factor F (m, p) of F Fᵀ; the whole matrix (m, m) where it has no short one."""

    name: str
    kind: str
    """``number``, ``field``, ``pose``, ``time``, ``travel``, ``effect``."""
    factor: Floats | None = None
    full: Floats | None = None

    def times(self, values: Floats) -> Floats:
        """(m,) product with values (m,)."""
        if self.factor is not None:
            return np.asarray(self.factor @ (self.factor.T @ values))
        assert self.full is not None
        return np.asarray(self.full @ values)

    @property
    def most(self) -> float:
        """Largest ln variance: what carries over in time is noise, if not of what is stated; else it takes whatever is smooth in a
        series that was read in order, and effects are judged by what they change from one reading to the next."""
        return WIDEST if self.kind == "time" else np.inf

    @property
    def sd(self) -> float:
        """Prior standard deviation of ln variance; infinite where it is flat."""
        return 2.0 * NUMBERS_SD if self.kind == "number" else np.inf


@dataclass(eq=False)
class Parts:
    """The parts that every model of some columns can have; matrices are made once."""

    columns: Columns
    numbers: tuple[Part, ...] = field(init=False)
    """One for each group."""
    together: tuple[Part, ...] = field(init=False)
    """One for all groups, and one for each that a set-up has for itself."""
    gaps: tuple[Part, ...] = field(init=False)
    travel: tuple[Part, ...] = field(init=False)
    """Errors along the travel of the drives."""

    def __post_init__(self) -> None:
        c = self.columns
        self.numbers = tuple(Part(name, "number", c.numbers[:, index]) for name, index in c.groups.items())
        shared = c.numbers[:, [not u.setup for u in c.unknowns]]
        alone = [p for p, i in zip(self.numbers, c.groups.values(), strict=True) if c.unknowns[i[0]].setup]
        self.together = (Part(ALL_NUMBERS, "number", shared), *alone) if c.unknowns else ()
        self.gaps = tuple(Part(name, kind, full=k) for kind, name, k in c.gaps)
        self.travel = tuple(Part(name, "travel", f) for name, f, _ in c.travel)

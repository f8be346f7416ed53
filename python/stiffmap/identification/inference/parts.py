"""Parts of the covariance of the readings that have an amplitude of their own; what an effect adds to the evidence, the mean over its sizes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import NUMBERS_SD, SIZES, WIDEST
from stiffmap.identification.numbers.unknowns import SAG

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
    most: float = np.inf
    """Largest ln variance."""

    def times(self, values: Floats) -> Floats:
        """(m,) product with values (m,)."""
        if self.factor is not None:
            return np.asarray(self.factor @ (self.factor.T @ values))
        assert self.full is not None
        return np.asarray(self.full @ values)

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
    """One for all groups, one for sag, and one for each that a set-up has for itself."""
    gaps: tuple[Part, ...] = field(init=False)
    travel: tuple[Part, ...] = field(init=False)
    """Errors along the travel of the drives."""

    def __post_init__(self) -> None:
        c = self.columns
        self.numbers = tuple(Part(name, "number", c.numbers[:, index]) for name, index in c.groups.items())
        apart = [bool(u.setup) or u.group == SAG for u in c.unknowns]
        shared = c.numbers[:, ~np.array(apart, dtype=bool)]
        alone = [p for p, i in zip(self.numbers, c.groups.values(), strict=True) if apart[i[0]]]
        self.together = (Part(ALL_NUMBERS, "number", shared), *alone) if c.unknowns else ()
        # what carries over in time is noise, if not of what is stated; else it takes whatever is smooth in a series that was read in
        # order, and effects are judged by what they change from one reading to the next
        self.gaps = tuple(
            Part(name, kind, full=k, most=WIDEST if kind == "time" else np.inf) for kind, name, k in c.gaps
        )
        self.travel = tuple(Part(name, "travel", f) for name, f, _ in c.travel)


def of_size(factor: Floats, root: Floats, solved: Floats, t: float) -> float:
    """ln of the mean over sizes of an effect with a factor (m, p), of the likelihood relative to that at its ln variance t in the model."""
    inside, z = spectrum(root, solved, factor)
    # without the effect (Woodbury): 1/λ grows by the variance that the model gives it
    b2 = np.exp(t)
    share = np.maximum(1.0 - b2 * inside, 1e-12)
    return float(
        log_mean(gains(inside / share, z / share)) - gains(inside / share, z / share, np.array([b2]))[0]
    )


def spectrum(root: Floats, solved: Floats, factor: Floats) -> tuple[Floats, Floats]:
    """(p,) information of a covariance about the directions of a factor (m, p), and (p,) what the readings say along them."""
    white = solve_triangular(root, factor, lower=True, check_finite=False)
    inside, vectors = np.linalg.eigh(white.T @ white)
    return inside, np.asarray(vectors.T @ (factor.T @ solved))


def gains(inside: Floats, z: Floats, squared: Floats = SIZES**2) -> Floats:
    """(..., B) gain of ln likelihood by an effect of size b along directions (..., p) of information `inside`."""
    a, s = inside[..., None], z[..., None] ** 2
    return np.asarray((0.5 * s * squared / (1.0 + a * squared) - 0.5 * np.log1p(a * squared)).sum(axis=-2))


def log_mean(values: Floats) -> Floats:
    """ln of the mean of exponentials over the last axis."""
    top = values.max(axis=-1, keepdims=True)
    return np.asarray(top[..., 0] + np.log(np.mean(np.exp(values - top), axis=-1)))

"""Periodic errors at many frequencies of many readings: their columns are never stored.

A column is sin or cos(2π f u), u a coordinate, times a change of the reading; for errors of several drives, the sum of
those. Products of all columns with a vector are then Fourier sums over the rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.candidates.fourier import Complex, Fourier

Numbers = NDArray[np.intp]
AT_ONCE = 64
"""Vectors that are transformed, and frequencies that are written out, together."""


@dataclass(frozen=True, eq=False)
class Waves:
    """R readings of n rows, F frequencies; sine and cosine are the two columns of each."""

    rows: Numbers
    """(R,) row of each reading, growing."""
    travels: tuple[Floats, ...]
    """(n,) coordinates."""
    slopes: tuple[Floats, ...]
    """(R,) change of each reading with each of them."""
    frequencies: Floats
    """(F,) equally spaced."""
    chosen: Numbers
    """(V,) those that are meant."""
    _known: dict[tuple[int, int, int], Fourier] = field(default_factory=dict)

    @staticmethod
    def of(rows: Numbers, travels: Sequence[Floats], slopes: Sequence[Floats], frequencies: Floats) -> Waves:
        """All frequencies."""
        return Waves(rows, tuple(travels), tuple(slopes), frequencies, np.arange(len(frequencies)))

    def only(self, chosen: Numbers) -> Waves:
        """Some of them; what was prepared is shared."""
        return replace(self, chosen=self.chosen[chosen])

    def along(self, y: Floats) -> Floats:
        """(V, 2, S) products of the columns with (R, S)."""
        return np.concatenate(
            [self._along(y[:, k : k + AT_ONCE]) for k in range(0, y.shape[1], AT_ONCE)]
            or [np.zeros((len(self.chosen), 2, 0))],
            axis=2,
        )

    def _along(self, y: Floats) -> Floats:
        total: Complex | float = 0.0
        for g, slope in enumerate(self.slopes):
            total = total + self._sums(g, g, 0, self._per_row(slope[:, None] * y))
        found = np.asarray(total)[self.chosen]
        return np.stack([found.imag, found.real], axis=1)

    def gram(self, problem: Problem) -> Floats:
        """(V, 2, 2) products of the whitened columns of each frequency."""
        if problem.blocks:  # readings that share a zero: no sums over single ones
            at = [self._lines(self.chosen[k : k + AT_ONCE]) for k in range(0, len(self.chosen), AT_ONCE)]
            return np.concatenate([_gram(problem, lines) for lines in at])
        out = self._weighted(problem)
        a = self.along(problem.unwhite(problem.nuisance))
        return out - a @ a.transpose(0, 2, 1)

    def _weighted(self, problem: Problem) -> Floats:
        """(V, 2, 2) products of the columns over the noise of each reading."""
        weight = problem.precision
        ss, cc, sc = (np.zeros(len(self.frequencies)) for _ in range(3))
        for g, one in enumerate(self.slopes):
            for h, other in enumerate(self.slopes[: g + 1]):
                a = self._per_row((weight * one * other)[:, None])
                twice = self._sums(g, h, 1, a)[:, 0]
                apart = np.full(len(ss), a.sum()) if g == h else self._sums(g, h, -1, a)[:, 0].real
                share = 0.5 if g == h else 1.0  # sines and cosines of two drives count in both orders
                ss += share * (apart - twice.real)
                cc += share * (apart + twice.real)
                sc += share * twice.imag
        return np.stack([np.stack([ss, sc], -1), np.stack([sc, cc], -1)], -2)[self.chosen]

    def arrays(self) -> Floats:
        """(V, 2, R) columns of all."""
        return self._lines(self.chosen)

    def line(self, k: int) -> Floats:
        """(2, R) columns of one."""
        return np.asarray(self._lines(self.chosen[k : k + 1])[0])

    def _lines(self, numbers: Numbers) -> Floats:
        out = np.zeros((len(numbers), 2, len(self.rows)))
        for travel, slope in zip(self.travels, self.slopes, strict=True):
            angle = 2 * np.pi * self.frequencies[numbers][:, None] * travel
            out[:, 0] += slope * np.sin(angle)[:, self.rows]
            out[:, 1] += slope * np.cos(angle)[:, self.rows]
        return out

    def _sums(self, g: int, h: int, sign: int, values: Floats) -> Complex:
        """(F, S) of (n, S): over the rows, times exp(2πi f u); u the coordinate g, plus or minus h."""
        key = (g, h, sign)
        if key not in self._known:
            places = self.travels[g] + sign * self.travels[h]
            first = float(self.frequencies[0])
            step = float(self.frequencies[1]) - first if len(self.frequencies) > 1 else 1.0
            self._known[key] = Fourier(places, first, step, len(self.frequencies))
        return self._known[key](values)

    def _per_row(self, values: Floats) -> Floats:
        """(n, S) sums over the readings of each row of (R, S)."""
        out = np.zeros((len(self.travels[0]), values.shape[1]))
        first = self._first
        out[self.rows[first]] = np.add.reduceat(values, first, axis=0)
        return out

    @cached_property
    def _first(self) -> Numbers:
        return np.flatnonzero(np.diff(self.rows, prepend=-1))


def _gram(problem: Problem, lines: Floats) -> Floats:
    white = problem.white_lines(lines.reshape(-1, lines.shape[-1])).T.reshape(len(lines), 2, -1)
    return np.asarray(white @ white.transpose(0, 2, 1))


@dataclass(frozen=True, eq=False)
class Wave:
    """One frequency of many."""

    waves: Waves
    number: int

    def __len__(self) -> int:
        return 2

    def array(self) -> Floats:
        """(2, R) its columns."""
        return self.waves.line(self.number)

"""Readings of a tap test, and static ones with them, against machines near the declared one (docs/theory.md V8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.table import TapTest
from stiffmap.model.addresses import moved, number
from stiffmap.model.description import AppliedEffect, Body, MachineDescription
from stiffmap.model.description.tree import all_elements
from stiffmap.model.effects import apply_records
from stiffmap.solve.machine import Machine

FELT = 0.05
"""Numbers whose uncertainty shifts no reading by more than this share of its noise are not fitted."""
LOST = 3.0
"""Residual, relative, of a mode that a machine no longer has."""
STEPS = 15
STEP = 0.02
"""Of a difference, in standard uncertainties or logarithms of a factor."""
Term = AppliedEffect | float | None
"""An effect, the mass of a body at the TCP in kg, or none."""


@dataclass(eq=False)
class Problem:
    """Residuals divided by the noise of the readings; numbers of the machine file that are uncertain move with them."""

    machine: Machine
    taps: TapTest
    statics: Experiment | None
    default_u: float
    numbers: list[tuple[str, float, float]] = field(default_factory=list)
    """Name, value and standard uncertainty of the numbers that readings feel."""

    def __post_init__(self) -> None:
        self.noise = self.taps.u / self.taps.frequency
        if self.statics is not None:
            at_first = Predictor(self.machine, self.statics)(())
            self.keep = self.statics.read & np.isfinite(at_first)
            self.noise = np.concatenate([self.noise, noise_of(self.statics).sigma[self.keep]])
        base = self._raw(self.machine)
        self.used = np.isfinite(base)
        self.is_tap: NDArray[np.bool_] = np.arange(len(base)) < len(self.taps)
        columns = []
        for key, value, u in uncertain_numbers(self.machine.description, self.default_u):
            other = shifted(self.machine.description, [(key, value, u)], np.ones(1))
            column = np.nan_to_num((self._raw(Machine(other, like=self.machine)) - base) / self.noise)
            if np.abs(column).max() > FELT:
                self.numbers.append((key, value, u))
                columns.append(column)
        self.slopes = np.stack(columns, axis=1) if columns else np.zeros((len(base), 0))

    def _raw(self, machine: Machine) -> Floats:
        parts = [np.log(predict_taps(machine, self.taps).frequency / self.taps.frequency)]
        if self.statics is not None:
            parts.append((Predictor(machine, self.statics)(()) - self.statics.reading)[self.keep])
        return np.concatenate(parts)

    def machine_with(self, term: Term, off: Floats | None = None) -> Machine:
        """The machine with an effect, its uncertain numbers off by so many standard uncertainties (numbers,)."""
        d = self.machine.description
        if off is not None and len(off):
            d = shifted(d, self.numbers, off)
        if isinstance(term, float):
            return Machine(replace(d, platform=(*d.platform, Body("tapped_load", term))), like=self.machine)
        return Machine(apply_records(d, [term]) if term else d, like=self.machine)

    def residual(self, term: Term = None, off: Floats | None = None) -> Floats:
        """(n,) by noise."""
        raw = self._raw(self.machine_with(term, off))
        return np.asarray(np.where(np.isfinite(raw), raw, LOST)[self.used] / self.noise[self.used])

    def whitener(self, part: str = "") -> tuple[NDArray[np.bool_], Floats]:
        """Rows (mask) of a part of the readings (``taps``, ``statics``, all), and what whitens them to first order."""
        tap = self.is_tap[self.used]
        rows = tap if part == "taps" else ~tap if part == "statics" else np.ones(len(tap), np.bool_)
        J = self.slopes[self.used][rows]
        return rows, np.linalg.inv(np.linalg.cholesky(np.eye(len(J)) + J @ J.T))

    def settled(self, term: Term = None, start: Floats | None = None) -> tuple[float, Floats]:
        """Least chi-square near a start with the uncertain numbers free within their uncertainty, and where they then are."""
        k = len(self.numbers)
        if not k:
            r = self.residual(term)
            return float(r @ r), np.zeros(0)

        def both(off: Floats) -> Floats:
            return np.concatenate([self._safe(term, off), off])

        fit = least_squares(
            both,
            np.zeros(k) if start is None else start,
            slopes_of(both),
            bounds=(-6, 6),
            x_scale=1.0,
            max_nfev=STEPS,
        )
        return float(2 * fit.cost), fit.x

    def _safe(self, term: Term, off: Floats) -> Floats:
        try:
            return self.residual(term, off)
        except StiffmapError:
            return np.asarray(np.full(int(self.used.sum()), 1e3))


def slopes_of(residual: Callable[[Floats], Floats]) -> Callable[[Floats], Floats]:
    """Differences of a residual by a step that does not shrink where a number is zero: frequencies carry round-off."""

    def slopes(t: Floats) -> Floats:
        here = residual(t)
        return np.stack([(residual(t + STEP * e) - here) / STEP for e in np.eye(len(t))], axis=1)

    return slopes


def uncertain_numbers(d: MachineDescription, default_u: float) -> list[tuple[str, float, float]]:
    """Names, values and standard uncertainties (SI): those that the machine file declares, and masses by `default_u`."""
    declared = dict(d.uncertainty)
    masses = {
        f"{full}/mass": default_u * e.mass
        for full, e in all_elements(d)
        if isinstance(e, Body) and e.mass > 0
    }
    both = {**masses, **declared}
    return [(k, v, u) for k, u in both.items() if u > 0 and (v := number(d, k)) is not None]


def shifted(
    d: MachineDescription, numbers: list[tuple[str, float, float]], off: Floats
) -> MachineDescription:
    """Numbers off by so many standard uncertainties; stiffness, compliance and mass by factors, so that they stay positive."""
    for (key, value, u), t in zip(numbers, off, strict=True):
        field_ = key.partition("/")[2]
        positive = value > 0 and field_.startswith(("compliance", "stiffness", "mass"))
        delta = value * (np.exp(t * u / value) - 1) if positive else t * u
        other = moved(d, key, float(delta))
        d = d if other is None else other
    return d

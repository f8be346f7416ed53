"""Readings that a machine is fitted to, under the amplitudes of a fit: what it does not explain is their covariance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.whitening import basis, readings_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.inference.amplitudes import NOTHING, Fit
from stiffmap.identification.inference.columns import Columns, drawn, zeros
from stiffmap.identification.inference.kernels import Covariance, ReadingPoints, covariance, gaps
from stiffmap.identification.inference.names import Inferred
from stiffmap.identification.inference.travel import DriveErrors, Profile, drives_of, knots_of
from stiffmap.identification.numbers.sensitivity import Sensitivity, predicted, sensitivity, zeros_anew
from stiffmap.identification.numbers.unknowns import Unknown, joint_name
from stiffmap.model.description import AppliedEffect
from stiffmap.model.description.tree import joints
from stiffmap.model.with_errors import Knots, edited
from stiffmap.solve.machine import Machine

STRAIGHT = 1e-3
"""m, rad: zeros of a set-up up to which a straight line does, within some micrometres; a machine for each set-up takes six times as long."""
MOST_FITTED = 9000
"""Readings that a machine is fitted to; of more, whole poses are drawn. Effort only."""


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings that a machine is fitted to, with the covariance of what it does not explain."""

    predictor: Predictor
    sigma: Floats
    """(n, c) m, rad."""
    rows: Integers
    """(N,)."""
    channel: Integers
    """(N,)."""
    kappa: float
    """Noise over the declared one."""
    weights: Floats
    """(N,) of heavy tails."""
    rest: Covariance
    """Of what nobody can name, of common zeros and of effects without a name, and of the noise."""
    sensitivity: Sensitivity
    spread: Floats
    """(p,) standard deviation of each number, in standard uncertainties."""
    drives: tuple[tuple[DriveErrors, Floats], ...] = ()
    """Drives that err along their travel, and the root (k, k) of the covariance at their knots, m² or rad²."""

    @cached_property
    def along(self) -> Floats:
        """(N, K) errors along the travel of all drives, whitened."""
        own = self.sigma[self.rows, self.channel][:, None]
        parts = [d.columns(self.rows, self.channel) @ r / own for d, r in self.drives]
        return self.rest.white(np.hstack([np.zeros((len(own), 0)), *parts]))

    @property
    def weighted_sigma(self) -> Floats:
        """(n, c) m, rad: standard deviations as heavy tails weigh the readings."""
        out = self.sigma.copy()
        out[self.rows, self.channel] /= np.sqrt(self.weights)
        return out

    @cached_property
    def columns(self) -> Floats:
        """(N, p) change of the readings per prior standard deviation of each number, whitened."""
        return self.white(self.sensitivity.columns) * self.spread

    def knots(self, found: Sequence[Profile]) -> dict[str, Knots]:
        """Axis positioning errors as a machine file has them."""
        of = joints(self.predictor.machine.description)
        return {p.drive: knots_of(of[joint_name(p.drive)], p) for p in found}

    def only(self, keep: Mask) -> Readings:
        """Those of some rows (n,)."""
        own = keep[self.rows]
        of_each: dict[str, Any] = {name: getattr(self, name)[own] for name in ("rows", "channel", "weights")}
        return replace(self, rest=self.rest.only(own), **of_each)

    def weighed(self, weights: Floats) -> Readings:
        """With other weights (N,)."""
        more = self.kappa**2 * (1.0 / weights - 1.0 / self.weights)
        return replace(self, weights=weights, rest=Covariance(self.rest.noise + more, self.rest.factor))

    def white(self, values: Floats) -> Floats:
        """(N, ...) of (n, c, ...), m or rad: whitened."""
        picked = values[self.rows, self.channel]
        return self.rest.white(
            picked / self.sigma[self.rows, self.channel].reshape(-1, *(1,) * (picked.ndim - 1))
        )

    def frames(self, prediction: Floats) -> Floats:
        """(N, q) orthonormal directions, whitened, of frames, tools and zeros where a machine stands that shows `prediction` (n, c)."""
        found = nuisance_columns(self.predictor.experiment, np.nan_to_num(prediction))
        return basis(self.white(found)) if found.shape[-1] else np.zeros((len(self.rows), 0))

    def predicted(
        self, numbers: Floats, effects: Sequence[AppliedEffect], travel: Mapping[str, Knots] | None = None
    ) -> Floats:
        """(n, c) m, rad, along straight lines of what a set-up has for itself as long as that is small; NaN where the machine cannot
        be."""
        p, names = self.predictor, self.sensitivity.unknowns
        small = [bool(u.setup) and abs(v) * u.u < STRAIGHT for u, v in zip(names, numbers, strict=True)]
        own = np.array(small, dtype=bool)
        of_setups = np.nan_to_num(self.sensitivity.columns[..., own]) @ numbers[own]
        try:
            if travel:
                p = p.beside(machine=Machine(edited(p.machine.description, {}, travel), like=p.machine))
            shared = predicted(p, names, np.where(own, 0.0, numbers), effects)
            return np.asarray(shared + of_setups)
        except StiffmapError:
            return np.full_like(self.sigma, np.nan)


def readings(
    predictor: Predictor,
    found: Inferred,
    fit: Fit,
    without_name: Sequence[Floats] = (),
    exact: Sequence[Unknown] = (),
) -> Readings:
    """The readings of an experiment under the amplitudes of a fit to what a search had.

    without_name
        (n, c) m, rad: what effects of the fit that have no name add to the readings.
    exact
        Numbers that are as declared, since an effect speaks of them.
    """
    e, columns, sigma = predictor.experiment, found.columns, found.noise.sigma
    rows, channel = readings_of(e, predictor())
    kept = drawn(e.groups[rows], 0, MOST_FITTED)
    rows, channel = rows[kept], channel[kept]
    own = sigma[rows, channel]
    points = ReadingPoints(rows, channel, own)
    some = columns.points
    amplitude = {p.name: float(np.exp(t)) for p, t in fit.on}
    kernels = [
        (k, amplitude[k.name] * scale)
        for k in gaps(predictor.machine, e, some)
        if k.name in amplitude and (scale := columns.scale_of(k)) > 0.0
    ]
    patterns = [np.nan_to_num(change[rows, channel])[:, None] / own[:, None] for change in without_name]
    weights = np.full(sigma.shape, 1.0)
    weights[found.suspects] = NOTHING
    weights[columns.rows, columns.channel] = fit.weights
    weights = weights[rows, channel]
    rest = covariance(points, some, kernels, fit.noise**2 / weights, np.hstack([zeros(e, points), *patterns]))
    size = {k: fit.spread(group) for group, index in columns.groups.items() for k in index}
    known = [(u, size[k]) for k, u in enumerate(columns.unknowns) if u not in exact]
    unknowns = tuple(u for u, s in known if s > 0.0)
    s = zeros_anew(sensitivity(predictor, found.uncertain), e)
    drives = tuple(_erring(predictor, s, columns, amplitude))
    index = [s.unknowns.index(u) for u in unknowns]
    s = replace(s, unknowns=unknowns, columns=s.columns[..., index])
    spread = np.array([size for _, size in known if size > 0.0])
    return Readings(predictor, sigma, rows, channel, fit.noise, weights, rest, s, spread, drives)


def _erring(
    predictor: Predictor, s: Sensitivity, columns: Columns, amplitude: Mapping[str, float]
) -> Iterator[tuple[DriveErrors, Floats]]:
    """Drives that err along their travel in a fit, with the roots at their knots; `amplitude`: variances of its parts, in noise."""
    variance = {name: amplitude[name] * sd**2 for name, _, sd in columns.travel if name in amplitude}
    for drive in drives_of(predictor, s) if variance else ():
        if any(name in variance for name, _ in drive.names()):
            yield drive, drive.root(variance)

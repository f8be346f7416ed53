"""An empirical correction of what nothing explains: a Gaussian process, labelled as such.

A smooth field over the workspace (`noise.field`), judged by poses it has not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.channels import metres
from stiffmap.experiment.comparison.summary import rms
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.field import covariance, shapes
from stiffmap.experiment.noise.folds import folds

LENGTHS = (0.5, 1.0, 2.0)
MOST_ROWS, SHAPES = 2000, 200
"""Rows beyond which the field is made of so many shapes."""


@dataclass(frozen=True, eq=False)
class Empirical:
    """What the correction leaves on held-out poses."""

    before: float
    after: float
    """rms of the linear readings, m."""
    length: float
    """Correlation length as a share of half the plan's extent."""
    field: Floats
    """(n, c) correction at every row, predicted without its pose."""


def empirical(experiment: Experiment, residual: Floats, sigma: Floats, seed: int) -> Empirical | None:
    """The best of a few correlation lengths; None where poses are too few to judge."""
    label, _ = folds(experiment, seed)
    if label.max() == 0:
        return None
    lengths = metres(experiment.channels)
    of = lengths & experiment.axis_read if (lengths & experiment.axis_read).any() else experiment.axis_read
    fields = [(_held(experiment, residual, sigma, label, s), s) for s in LENGTHS]
    field, length = min(fields, key=lambda f: rms((residual - f[0])[:, of]))
    return Empirical(rms(residual[:, of]), rms((residual - field)[:, of]), length, field)


def _held(e: Experiment, residual: Floats, sigma: Floats, label: Integers, length: float) -> Floats:
    if len(e) > MOST_ROWS:
        return _held_by_shapes(residual, sigma, label, shapes(e, SHAPES, length))
    kernel = covariance(e, length)
    out = np.full_like(residual, np.nan)
    for axis in np.flatnonzero(np.isfinite(residual).any(axis=0)):
        for fold in np.unique(label):
            train = np.flatnonzero((label != fold) & np.isfinite(residual[:, axis]))
            test = np.flatnonzero(label == fold)
            y, noise = residual[train, axis], sigma[train, axis]
            size = _size(y, noise)
            v = size * kernel[np.ix_(train, train)] + np.diag(noise**2)
            out[test, axis] = size * kernel[np.ix_(test, train)] @ np.linalg.solve(v, y)
    return out


def _size(y: Floats, noise: Floats) -> float:
    """Variance of the field."""
    return max(float(np.var(y) - np.mean(noise**2)), 0.01 * float(np.mean(noise**2)))


def _held_by_shapes(residual: Floats, sigma: Floats, label: Integers, shape: Floats) -> Floats:
    """The same of a field with the covariance F Fᵀ of shapes F (n, k): sums over folds, and what each fold adds to them."""
    out = np.full_like(residual, np.nan)
    names = np.unique(label)
    for axis in np.flatnonzero(np.isfinite(residual).any(axis=0)):
        read = np.isfinite(residual[:, axis])
        y, noise = np.where(read, residual[:, axis], 0.0), sigma[:, axis]
        f = shape / np.where(read, noise, np.inf)[:, None]
        right = y / np.where(read, noise, 1.0)
        parts = [f[label == k].T @ f[label == k] for k in names]
        sides = [f[label == k].T @ right[label == k] for k in names]
        for k, part, side in zip(names, parts, sides, strict=True):
            train = read & (label != k)
            size = _size(y[train], noise[train])
            normal = sum(parts) - part + np.eye(len(side)) / size
            out[label == k, axis] = shape[label == k] @ np.linalg.solve(normal, sum(sides) - side)
    return out

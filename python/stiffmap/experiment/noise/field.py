"""A smooth field over the workspace that does not depend on the machine.

Position: a field over the commanded position per channel. Deflection: a smooth compliance, i.e. a field per wrench
component times that component, plus a smooth field.
"""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats, Integers

TOUCHED = 0.1
"""Share of a height's spread that its sum with the commanded height keeps where the command was the reading."""
MOST_SEEN = 300
"""Rows from which shapes of the field are taken; more tell the same."""
FAINT = 1e-4
"""Share of the largest shape's variance below which one is left out."""


def covariance(e: Experiment, length: float) -> Floats:
    """(n, n) correlation of the field between rows; `length` in halves of the plan's extent."""
    return _between(e, length, np.arange(len(e), dtype=np.intp))


def shapes(e: Experiment, number: int, length: float) -> Floats:
    """(n, k ≤ number) columns F with F Fᵀ the covariance of the field, as near as so few can be (Nyström)."""
    _, first = np.unique(np.hstack([e.groups[:, None], e.wrench]), axis=0, return_index=True)
    if len(first) > MOST_SEEN:
        first = np.sort(np.random.default_rng(0).permutation(first)[:MOST_SEEN])
    across = _between(e, length, first)
    size, vectors = np.linalg.eigh(across[first])
    largest = np.argsort(size)[::-1][:number]
    kept = largest[size[largest] > FAINT * size.max()]
    return np.asarray(across @ (vectors[:, kept] / np.sqrt(size[kept])))


def _between(e: Experiment, length: float, some: Integers) -> Floats:
    x = unit(free_position(e))
    smooth = np.exp(-0.5 * ((x[:, None, :] - x[None, some, :]) ** 2).sum(axis=-1) / length**2)
    if e.quantity == "position":
        return np.asarray(smooth)
    w = e.wrench / max(float(np.abs(e.wrench).max()), 1e-300)
    return np.asarray(smooth * (0.2 + w @ w[some].T))


def free_position(e: Experiment) -> Floats:
    """(n, 3) m, commanded positions; where a surface was touched, without the coordinate that was the reading."""
    names = [c.name for c in e.channels]
    if "hh" not in names:
        return e.position
    normal = np.array(e.normal)
    height = e.position @ normal
    reading = e.reading[:, names.index("hh")]
    if not np.nanstd(reading + height) < TOUCHED * np.nanstd(reading):
        return e.position
    along = np.abs(normal) == np.abs(normal).max()
    return np.asarray(np.where(along, 0.0, e.position - np.outer(height, normal)))


def unit(x: Floats) -> Floats:
    """Columns mapped to [-1, 1]; constant ones to 0."""
    low, high = x.min(axis=0), x.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    return np.asarray(np.where(high > low, 2 * (x - low) / span - 1, 0.0))

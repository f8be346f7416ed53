"""Coordinates over which a smooth field may go."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats

TOUCHED = 0.1
"""Share of a height's spread that its sum with the commanded height keeps where the command was the reading."""


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

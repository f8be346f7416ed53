"""What makes an experiment unusable."""

from __future__ import annotations

import numpy as np

from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats

FEWEST = 6
"""Readings: as many as the parameters of the largest effect."""


def refuse(experiment: Experiment, base: Floats) -> None:
    """Raises StiffmapError for poses that the machine cannot reach and for too few readings."""
    refuse_unreachable(experiment, base)
    number = int(experiment.read.sum())
    if number < FEWEST:
        raise StiffmapError(
            f"{experiment.name}: {number} readings are fewer than the parameters of an effect "
            f"and its test need ({FEWEST})"
        )


def refuse_unreachable(experiment: Experiment, base: Floats) -> None:
    """Raises StiffmapError naming the rows whose readings `base` (n, c) has no prediction for."""
    failed = np.flatnonzero((experiment.read & ~np.isfinite(base)).any(axis=1))
    if not failed.size:
        return
    rows = ", ".join(experiment.ids[i] for i in failed[:5]) + (" ..." if failed.size > 5 else "")
    where = ", ".join(f"{1e3 * v:.1f}" for v in experiment.position[failed[0]])
    raise StiffmapError(
        f"{experiment.name}: the machine has no equilibrium at {failed.size} row"
        f"{'s' if failed.size > 1 else ''} (id {rows}; first at ({where}) mm): "
        "out of reach, or units are wrong"
    )

"""What makes an experiment unusable, and what it cannot tell."""

from __future__ import annotations

import numpy as np

from stiffmap.diagnosis.study import Study
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats

FEWEST = 6


def refuse(experiment: Experiment, base: Floats) -> None:
    """Raises StiffmapError for poses that the machine cannot reach and for too few readings."""
    failed = np.flatnonzero(experiment.read.any(axis=1) & ~np.isfinite(base).any(axis=1))
    if failed.size:
        rows = ", ".join(experiment.ids[i] for i in failed[:5]) + (" ..." if failed.size > 5 else "")
        where = ", ".join(f"{1e3 * v:.1f}" for v in experiment.position[failed[0]])
        raise StiffmapError(
            f"{experiment.name}: the machine has no equilibrium at {failed.size} rows "
            f"(id {rows}; first at ({where}) mm): "
            "out of reach, or units are wrong"
        )
    number = int(experiment.read.sum())
    if number < FEWEST:
        raise StiffmapError(
            f"{experiment.name}: {number} readings are fewer than the parameters of an effect "
            f"and its test need ({FEWEST})"
        )


def limitations(study: Study) -> list[str]:
    """What the reader must know, in sentences."""
    e = study.experiment
    out = [f"contradictory repeats: {c}" for c in study.noise.contradictions()]
    if e.groups.max() == 0:
        out.append(
            "all rows are one pose: what changes over the workspace cannot be told, nothing is held out"
        )
    if not (study.noise.freedom > 0).any():
        out.append("no repeats: the declared noise is believed")
    box = study.description.workspace
    if box is not None:
        low, high = np.array(box)
        outside = ((e.position < low - 1e-9) | (e.position > high + 1e-9)).any(axis=1)
        if outside.any():
            out.append(f"{int(outside.sum())} rows lie outside the declared workspace")
    if e.quantity == "deflection" and not e.branch:
        out.append("no branch column: friction is judged as if every load came from zero")
    return out

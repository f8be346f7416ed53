"""What an experiment cannot tell."""

from __future__ import annotations

import numpy as np

from stiffmap.diagnosis.study import Study


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

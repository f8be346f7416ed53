"""What the data could not see: the smallest effect that this experiment would have revealed."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.report.effects import as_place
from stiffmap.identification.diagnosis.report.findings import Detectability
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.places import Place, reach

POWER = 0.95


def detectable(columns: Columns, fit: Fit) -> list[Detectability]:
    """One entry per place: the sizes that gain the odds of a name over all places, with 95 % power, in the model that was found."""
    needed = np.sqrt(2.0 * np.log(ODDS * max(1, len(columns.places)))) + norm.isf(1.0 - POWER)
    out = []
    for place in columns.places:
        sizes = _sizes(columns, fit, place, float(needed))
        if any(v is not None for v in sizes.values()):
            c = place.candidate
            out.append(Detectability(c.kind, c.element, c.legs, sizes, [as_place(a) for a in place.aliases]))
    return out


def _sizes(columns: Columns, fit: Fit, place: Place, needed: float) -> dict[str, float | None]:
    """The median over shapes (periods)."""
    linear = place.candidate.linear
    each: list[Floats] = []
    for shape in place.shapes[:: max(1, len(place.shapes) // 5)]:
        white = fit.white(columns.rotated(columns.lines(shape.variant)))
        if white.shape[1] != len(linear):
            return dict.fromkeys((p.name for p in linear), None)
        with np.errstate(divide="ignore"):
            each.append(needed / np.linalg.norm(white, axis=0))
    out: dict[str, float | None] = {}
    for p, size in zip(linear, np.median(each, axis=0), strict=True):
        out[p.name] = float(size) * p.scale if float(size) < reach(p) else None
    return out

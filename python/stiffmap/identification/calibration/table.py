"""What the readings say of each declared number, and which directions of them they determine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.amplitudes import OFF, Fit, evaluated
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.corrected import Corrected
from stiffmap.identification.inference.shares import of_numbers

SEEN = 1.0
"""Singular value, per standard uncertainty, beyond which the readings determine a direction more than its prior does."""


@dataclass(frozen=True)
class Row:
    """One unknown: declared standard uncertainty, posterior, and whether the readings determine it."""

    name: str
    group: str
    leg: str
    unit: str
    """``m``, ``rad``, ``1`` or ``ln`` (logarithm of a factor)."""
    value: float
    """Posterior mean of its error."""
    u: float
    sigma: float
    """Posterior standard deviation."""
    pull: float
    """Value over the standard deviation that it should have if `u` is right."""
    identifiable: bool
    """Whether the readings say more of it than its prior does."""
    observability: float
    """How many times the readings sharpen its prior."""
    minimal: bool
    """Whether it belongs to the minimal set that spans all that the readings determine."""


def table_of(columns: Columns, fit: Fit, best: Corrected | None) -> tuple[tuple[Row, ...], int]:
    """Rows of all numbers that the readings show, with their values at the optimum, and how many directions the readings
    determine."""
    at = {}
    if best is not None:
        at = {u.name: float(v) for u, v in zip(best.given.sensitivity.unknowns, best.numbers, strict=True)}
    numbers = [p.name for p in fit.parts if p.kind == "number"]
    white = fit.without(numbers).white(columns.numbers)
    gram = white.T @ white
    minimal = set(independent(gram))
    prior = np.ones(len(columns.unknowns))
    for group, index in columns.groups.items():
        prior[index] = max(
            1.0, fit.spread(group)
        )  # a group that is off by little here has no better tolerances for it
    spread = np.sqrt(np.diag(np.linalg.inv(np.diag(prior**-2) + gram)))
    out = []
    said = of_numbers(columns, fit)
    for k, (u, (value, _, _)) in enumerate(zip(columns.unknowns, said, strict=True)):
        value, sd = at.get(u.name, value), float(spread[k])
        informed = 1.0 - (sd / prior[k]) ** 2
        pull = float(value / np.sqrt(informed)) if informed > 1e-9 else 0.0
        row = Row(
            u.name,
            u.group,
            u.leg,
            u.unit,
            value * u.u,
            u.u,
            sd * u.u,
            pull,
            bool(informed > 0.5),
            float(prior[k] / sd),
            k in minimal,
        )
        out.append(row)
    return tuple(out), int((np.linalg.eigvalsh(gram) > SEEN**2).sum())


def independent(gram: Floats) -> NDArray[np.intp]:
    """A minimal set of unknowns that spans what the readings determine.

    Pivoted elimination of AᵀA: the unknown that is most observable comes first and is projected out of the others, until what
    remains of each is below `SEEN`.
    """
    left = np.array(gram, dtype=float)
    kept: list[int] = []
    for _ in range(len(left)):
        size = np.diag(left).copy()
        size[kept] = -np.inf
        best = int(np.argmax(size))
        if not size[best] > SEEN**2:
            break
        kept.append(best)
        left = left - np.outer(left[best], left[best]) / left[best, best]
    return np.array(sorted(kept), dtype=np.intp)


def too_wide(fit: Fit) -> dict[str, float]:
    """Groups whose numbers are off by so many times their standard uncertainties (rms), where these are too small without doubt."""
    out = {}
    for k, p in enumerate(fit.parts):
        t = float(fit.t[1 + k])
        if p.kind != "number" or t <= max(0.0, OFF):
            continue
        other = fit.t.copy()
        other[1 + k] = 0.0
        if fit.score - evaluated(fit.columns, fit.parts, other, fit.weights).score > np.log(ODDS):
            out[p.name] = float(np.exp(0.5 * t))
    return out

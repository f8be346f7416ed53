"""How a residual is shared out: posterior means of noise, declared numbers, effects, gaps, poses and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.number_text import percents
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.amplitudes import Fit, fitted, noise_part
from stiffmap.identification.inference.columns import Columns, along
from stiffmap.identification.inference.constants import ODDS, STANDS_OUT
from stiffmap.identification.inference.kernels import wandering
from stiffmap.identification.inference.parts import GAPS, NOISE, Part, Parts
from stiffmap.identification.numbers.unknowns import SAG, Unknown

LEAST = 0.005
"""Share from which a part is named."""


@dataclass(frozen=True)
class WideGroup:
    """Declared numbers whose standard uncertainties are too small without doubt."""

    group: str
    factor: float
    """They are off by so many times their standard uncertainties (rms)."""

    def __str__(self) -> str:
        return (
            f"{self.group}: {self.factor:.2g} times as far off (rms) as their standard uncertainties say; give those that "
            f"this machine has (u in its file), or --tolerance {self.factor:.2g}"
        )


def shares(columns: Columns, fit: Fit) -> dict[str, float]:
    """Share of each part: |E[part | r]|² over the sum of all of them, r the readings' difference from the declared machine; readings
    that stand alone are not counted."""
    kept = columns.free[fit.weights >= 1.0 / STANDS_OUT]
    means = {p.name: fit.mean(p) for p, _ in fit.on}
    squares = {name: float(np.sum((kept @ m) ** 2)) for name, m in means.items()}
    squares[NOISE] = float(np.sum(noise_part(fit)[0][fit.weights >= 1.0 / STANDS_OUT] ** 2))
    whole = max(sum(squares.values()), 1e-300)
    return {name: s / whole for name, s in squares.items()}


def largest(shares: Mapping[str, float], most: int | None = None) -> list[str]:
    """``drive x: 12 %``: the parts of at least half a per cent, the largest first."""
    found = [(p, s) for p, s in sorted(shares.items(), key=lambda s: -s[1]) if s >= LEAST][:most]
    return [f"{p}: {whole} %" for (p, _), whole in zip(found, percents([s for _, s in found]), strict=True)]


def of_numbers(columns: Columns, fit: Fit) -> list[tuple[float, float, float]]:
    """Per declared number its posterior mean and standard deviation, in standard uncertainties, and the squares of what it
    shows over those of all readings."""
    whole = max(float(np.sum(fit.columns.residual**2)), 1e-300)
    out = [(0.0, 1.0, 0.0)] * len(columns.unknowns)
    for name, index in columns.groups.items():
        variance = fit.spread(name) ** 2
        d = columns.numbers[:, index]
        information = np.sum(fit.white(d) ** 2, axis=0)
        mean = variance * (d.T @ fit.solved)
        sd = np.sqrt(np.maximum(variance * (1.0 - variance * information), 0.0))
        share = mean**2 * np.sum(d**2, axis=0) / whole
        for k, m, s, part in zip(index, mean, sd, share, strict=True):
            out[int(k)] = (float(m), float(s), float(part))
    return out


def gap_of(columns: Columns, fit: Fit) -> Floats:
    """(n, c) m, rad: what nobody can name, at the readings that were compared; NaN elsewhere."""
    out = np.full(columns.experiment.reading.shape, np.nan)
    whole = sum((fit.mean(p) for p, _ in fit.on if p.kind in GAPS), np.zeros(len(columns)))
    out[columns.rows, columns.channel] = columns.sigma * (columns.free @ whole)
    return out


def too_wide(fit: Fit, named: Sequence[Unknown] = ()) -> tuple[WideGroup, ...]:
    """Groups whose standard uncertainties are too small without doubt, whatever the numbers are that are `named` out of tolerance."""
    c, out = fit.columns, []
    own = tuple(Part(u.name, "effect", c.numbers[:, [c.unknowns.index(u)]]) for u in named)
    if own:
        fit = fitted(c, (*fit.parts, *own), fit.amplitudes, fit.weights)
    named_sag = any(u.group == SAG for u in named)  # no tolerance of a maker's
    # noise, and all that nobody can name, may be instead, but no other numbers that are farther off
    bounded = [
        replace(p, most=max(0.0, float(t))) if p.kind == "number" else p
        for p, t in zip(fit.parts, fit.t[1:], strict=True)
    ]
    for k, p in enumerate(fit.parts):
        t = float(fit.t[1 + k])
        if p.kind != "number" or t <= 0.0 or (p.name == SAG and named_sag):
            continue
        assert p.factor is not None
        as_stated = replace(c, zero=c.zero + p.factor @ p.factor.T)
        others = fitted(as_stated, bounded[:k] + bounded[k + 1 :], fit.amplitudes, fit.weights)
        if fit.score - others.score > np.log(ODDS):
            out.append(WideGroup(p.name, float(np.exp(0.5 * t))))
    return tuple(out)


def from_row_to_row(fit: Fit) -> bool:
    """Whether more than noise goes on from row to row of an experiment of which nobody says in which order it was read."""
    c, e = fit.columns, fit.columns.experiment
    if e.hours is not None or e.order is not None:
        return False
    found = along(wandering(e, np.arange(float(len(e)))), c.points, c.free)
    over = Parts(replace(c, gaps=found)).gaps
    more = fitted(c, (*fit.parts, *over), fit.amplitudes, fit.weights)
    return more.score - fit.score > float(np.log(ODDS))


def tolerance_word(beyond: str, wide: Sequence[WideGroup]) -> str:
    """The verdict on declared numbers that are not as declared; `beyond`: names of those that no tolerance allows."""
    return f"beyond tolerance: {beyond}" if beyond else f"adjusted {'beyond' if wide else 'within'} tolerance"

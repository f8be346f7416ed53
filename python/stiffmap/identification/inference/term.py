"""An effect that is fitted: its values, what the readings determine of them, and what it can do without."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import norm

from stiffmap.experiment.experiment import Floats, Mask
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.inference.places import possible
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import get

WIDE = float(norm.isf(0.025))
"""Standard deviations of a 95 % interval to either side."""
AT_BOUND = 1e-3
"""Of a parameter's scale, within which it is at a bound."""


@dataclass(frozen=True, eq=False)
class Term:
    """An effect that is fitted: all its parameters, in their scales."""

    candidate: Candidate
    values: Floats
    """(q,)."""
    sd: Floats = field(default_factory=lambda: np.zeros(0))
    """(q,) their standard deviations at an optimum, everything else integrated out; infinite where the readings determine nothing."""

    @staticmethod
    def of(candidate: Candidate, term: AppliedEffect) -> Term:
        """With the values (SI) of an effect."""
        given = dict(term.parameters)
        found = [float(given.get(p.name, p.null or 0.0)) / p.scale for p in candidate.parameters]
        return Term(candidate, np.clip(np.array(found), *Term(candidate, np.zeros(0)).bounds))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """(q,) least and largest values."""
        both = [possible(p) if p.null is not None else (p.lower, p.upper) for p in self.candidate.parameters]
        scale = np.array([p.scale for p in self.candidate.parameters])
        low, high = (np.array(side, dtype=float) / scale for side in zip(*both, strict=True))
        return low, high

    def effect(self, values: Floats) -> AppliedEffect:
        """With other values."""
        p = self.candidate.parameters
        return self.candidate.term([float(v) * q.scale for v, q in zip(values, p, strict=True)])

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """(q,) lower and upper ends of 95 % intervals, whatever the bounds."""
        return self.values - WIDE * self.sd, self.values + WIDE * self.sd

    @property
    def nulls(self) -> Floats:
        """(q,) values at which the effect vanishes; NaN where there is none."""
        return np.array([np.nan if p.null is None else p.null / p.scale for p in self.candidate.parameters])

    @property
    def undetermined(self) -> Mask:
        """(q,) parameters whose interval is all that they can be, shapes at a bound, and strengths if all are at one."""
        (low, high), (least, most) = self.bounds, self.ends
        shape = np.isnan(self.nulls)
        near = [(np.abs(self.values - b) < AT_BOUND) & (b != self.nulls) for b in (low, high)]
        at = near[0] | near[1]
        return np.asarray(((least <= low) & (most >= high)) | (at & (shape | at[~shape].all())))

    @property
    def spare(self) -> Mask:
        """(q,) parameters that are not determined and that the effect can do without: at their null, or their default."""
        p, vector = self.candidate.parameters, get(self.candidate.kind).vector
        may = [q.default is not None or q.name in vector for q in p]
        shape = np.isnan(self.nulls)
        least, most = self.ends
        idle = (least <= self.nulls) & (self.nulls <= most) & (len(self.candidate.linear) > 1)
        return np.asarray(self.undetermined & may & (shape | idle))

    def without(self, k: int) -> Term:
        """Without one parameter, from the same values."""
        p = self.candidate.parameters
        return Term(replace(self.candidate, parameters=p[:k] + p[k + 1 :]), np.delete(self.values, k))

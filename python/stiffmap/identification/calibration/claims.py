"""What may be accepted as beyond tolerance: it must gain with a smooth field that does not depend on the machine in the model, hold on
readings that it has not seen, and be no further off than a number of this machine can be.

A calibration has many numbers; some of them imitate in part whatever the readings show. Numbers that are the cause
explain it better than any smooth function of pose and load does; numbers that imitate do not (docs/theory.md I3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.field import shapes
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration.beyond import (
    BeyondTolerance,
    as_factor,
    beyond_tolerance,
    none_beyond,
)
from stiffmap.identification.calibration.certificate import INSTRUMENT
from stiffmap.identification.calibration.facts import Wider
from stiffmap.identification.calibration.floor import Blocks, likeliest
from stiffmap.identification.calibration.groups import LIKE, STRONG
from stiffmap.identification.calibration.limits import refused
from stiffmap.identification.calibration.statistics import Sums
from stiffmap.identification.calibration.unknowns import Unknown

LENGTHS = (0.75, 1.5)
"""Correlation lengths of the field that are tried, in halves of the plan's extent."""
SIZES = (0.3, 1.0, 3.0, 10.0)
"""Standard deviations of the field that are tried, in rms of what the calibration leaves of each channel."""
MOST_SHAPES, MOST_COLUMNS = 80, 240
"""Of the field, per channel and in all."""


LEAST_SHARE, BISECTIONS = 1e-4, 20
"""Of a standard uncertainty: how far a prior is narrowed that readings overrun, and in how many steps."""

Why = Callable[[Floats, Floats, Sequence[int]], str]
"""Factors (p,) on the standard uncertainties before a claim and with it, numbers of the unknowns that it lets go -> why
it does not stand; empty: it does."""


@dataclass(frozen=True, eq=False)
class Claims:
    """Which numbers are beyond tolerance, alone or as a group."""

    singles: BeyondTolerance
    groups: tuple[Wider, ...]
    factor: Floats
    """(p,) on the standard uncertainties."""
    refused: tuple[str, ...] = ()
    """What the evidence asked for and is not claimed, and why."""
    found_again: Mapping[str, float] = field(default_factory=dict)
    """Share of other draws of as many readings that would show each claim."""

    @property
    def any(self) -> bool:
        """Whether anything is claimed."""
        return bool(self.singles.found or self.groups)

    def withdrawn(self, why: str) -> Claims:
        """Nothing of it claimed."""
        names = (*(b.name for b in self.singles.found), *(f"{w.group} as a whole" for w in self.groups))
        none = none_beyond(len(self.factor))
        return Claims(none, (), none.factor, (*self.refused, *(f"{n}: {why}" for n in names)))


def claims(
    sums: Sums,
    unknowns: Sequence[Unknown],
    members: Mapping[str, Sequence[int]],
    folds: Sequence[Sums],
    at: Floats | None,
    why_not: Why,
) -> Claims:
    """Single numbers or groups that the evidence asks for, one after the other, as far as they stand."""
    singles = beyond_tolerance(sums, unknowns, folds, at)
    groups, wide = widened(sums, members, (INSTRUMENT,))
    if singles.found and groups and _many_a_little(sums, singles, groups, wide, members):
        singles = none_beyond(len(unknowns))
    absurd = singles.refused
    factor = np.ones(len(unknowns))
    for k, b in enumerate(singles.found):
        trial = singles.first(k + 1).factor
        why = why_not(factor, trial, [singles.which[k]])
        if why:
            return Claims(singles.first(k), (), factor, (*absurd, f"{b.name}: {why}"))
        factor = trial
    if singles.found:
        groups, _ = widened(sums.scaled(factor), members, (INSTRUMENT,))
    for k, w in enumerate(groups):
        trial = factor.copy()
        which = list(members[w.group])
        trial[which] *= w.factor
        why = _absurd(sums, unknowns, trial, which, at) or why_not(factor, trial, which)
        if why:
            refused = (*absurd, f"{w.group} as a whole: {why}")
            # that many numbers are off is no answer where it does not suffice
            return (
                Claims(singles, groups[:k], factor, refused)
                if singles.found or not k
                else Claims(singles, groups[:k], factor, absurd).withdrawn(
                    f"not without {w.group}, and {why}"
                )
            )
        factor = trial
    return Claims(singles, groups, factor, absurd)


def _absurd(
    sums: Sums, unknowns: Sequence[Unknown], factor: Floats, which: Sequence[int], at: Floats | None
) -> str:
    """Why a group is not widened: a number of it would be one that no machine has."""
    values = sums.scaled(factor).estimate * factor
    for i in which:
        times = (
            as_factor(unknowns[i], float(values[i]), 0.0 if at is None else at[i])
            if unknowns[i].unit == "ln"
            else 1.0
        )
        if why := refused(unknowns[i], float(values[i]), times):
            return f"{unknowns[i].name}: {why}"
    return ""


def _many_a_little(
    sums: Sums,
    singles: BeyondTolerance,
    groups: Sequence[Wider],
    wide: Floats,
    members: Mapping[str, Sequence[int]],
) -> bool:
    """Whether groups that are off as a whole explain more than single numbers with the others free as well."""
    _, beside = widened(sums.scaled(singles.factor), members, (INSTRUMENT,))
    one = sums.scaled(singles.factor * beside).log_evidence
    return groups[0].nats > singles.found[0].nats and sums.scaled(wide).log_evidence > one


def held_within(sums: Sums, factor: Floats, which: Sequence[int], within: float) -> Floats:
    """(p,) factors under which the unknowns `which` stay within so many standard uncertainties (rms), times `factor` (p,).

    Many readings overrun a prior: numbers are then far beyond their uncertainties, whatever these say. What a claim
    gains is measured against a fit that holds the numbers where tolerances allow them to be.
    """
    out = factor.copy()
    which = list(which)

    def size(share: float) -> float:
        out[which] = factor[which] * share
        t = sums.scaled(out).estimate[which] * share
        return float(np.sqrt(np.mean(t**2)))

    if size(1.0) <= within:
        return factor
    low, high = LEAST_SHARE, 1.0
    for _ in range(BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if size(middle) > within else (middle, high)
    size(low)
    return out


@dataclass(frozen=True, eq=False)
class BesideField:
    """Readings with a smooth field of unknown size and length below all unknowns."""

    blocks: tuple[Blocks, ...]
    """Per length of the field; columns of the unknowns, then those of the field."""
    unknowns: int

    @staticmethod
    def of(problem: Problem, columns: Floats, linear: Floats, label: Integers, left: Floats) -> BesideField:
        """`columns` (N, p) and `linear` (N,) whitened, `label` (N,) of their blocks; `left` (n, c) what the calibration
        leaves in SI."""
        fields = (problem.white(field_columns(problem.experiment, left, length)) for length in LENGTHS)
        blocks = tuple(Blocks.of(np.hstack([columns, field]), linear, label) for field in fields)
        return BesideField(blocks, columns.shape[1])

    def log_evidence(self, factor: Floats) -> float:
        """Of the unknowns at `factor` (p,) times their uncertainties, jointly with the field and the floor that suit best."""
        best = self.at(factor, 0.0)
        for k in range(len(self.blocks)):
            before = -np.inf
            for size in SIZES:
                here = self.at(factor, size, k)
                if here < before:
                    break
                before = here
            best = max(best, before)
        return best

    def at(self, factor: Floats, size: float, length: int = 0) -> float:
        """ln of the evidence for a field of one size and length, at the floor that suits best."""
        blocks = self.blocks[length]
        which = np.arange(self.unknowns if size == 0.0 else len(blocks.within.right))
        scale = np.append(factor, np.full(len(which) - self.unknowns, size))
        blocks = blocks.pick(which).scaled(scale)
        return max(likeliest(blocks, 0.1)[1], blocks.log_likelihood(0.0))


def field_columns(e: Experiment, left: Floats, length: float) -> Floats:
    """(n, c, k) change of the readings per unit of each shape of the field: a shape for each channel that is read, as
    large as what is left of it."""
    read = np.flatnonzero(e.axis_read)
    shape = shapes(e, min(MOST_SHAPES, MOST_COLUMNS // max(len(read), 1)), length)
    size = np.sqrt(np.nanmean(left[:, read] ** 2, axis=0))
    out = np.zeros((*left.shape, len(read), shape.shape[1]))
    for k, c in enumerate(read):
        out[:, c, k] = size[k] * shape
    return np.asarray(out.reshape(*left.shape, -1))


# Groups of unknowns that are off by more than their standard uncertainties say, all of them.
#
# Where no single number stands out, those of one group may all be worse than declared: each group's standard
# uncertainties in turn are multiplied by what the evidence gains most by (its hyperparameter by maximum likelihood).

TIMES = (3.0, 10.0)
FEWEST = 2
"""Unknowns that make a group; one that is off alone is `beyond_tolerance`'s."""


def widened(
    sums: Sums, members: Mapping[str, Sequence[int]], certain: Sequence[str]
) -> tuple[tuple[Wider, ...], Floats]:
    """The groups whose uncertainties are too small, and (p,) the factor on each; `certain` groups stay."""
    factor = np.ones(len(sums.right))
    groups = {g: list(i) for g, i in members.items() if len(i) >= FEWEST and g not in certain}
    price = STRONG + float(np.log(max(len(groups) * len(TIMES), 1)))
    found: list[Wider] = []
    while True:
        now = sums.scaled(factor).log_evidence
        trials: dict[str, tuple[float, float]] = {}
        for g, which in groups.items():
            for f in TIMES if g not in [w.group for w in found] else ():
                trial = factor.copy()
                trial[which] *= f
                gain = sums.scaled(trial).log_evidence - now
                trials[g] = max(trials.get(g, (-np.inf, 1.0)), (gain, f))
        best = max(trials, key=lambda g: trials[g][0], default=None)
        if best is None or trials[best][0] < price:
            return tuple(found), factor
        nats, times = trials[best]
        all_gained = now + nats - sums.pick([]).log_evidence
        enough = max(nats - max(STRONG, LIKE * all_gained), STRONG)
        rivals = tuple(g for g, (gain, _) in trials.items() if g != best and gain > enough)
        factor[groups[best]] *= times
        found.append(Wider(best, times, float(nats), rivals))

"""Which explanation leads, which mean the same to this plan, and which remain as rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.fitting.fit import fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.alias import AliasClass, coarseness
from stiffmap.identification.diagnosis.search.selection import FEWEST, Search, additions, score
from stiffmap.identification.diagnosis.search.study import Study
from stiffmap.model.effects import registry

EQUAL = 2.0
"""Difference of scores (ln) within which explanations count as equally good."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """The model that the verdict names, and what else the readings allow."""

    model: Model
    aliases: tuple[tuple[Candidate, Candidate, Model], ...] = ()
    """Effect of the model, its alias at the size found, and the model with the alias in its place."""
    others: tuple[Model, ...] = ()
    """Rivals that another plan, or luck, would have distinguished."""


def explain(s: Study, search: Search, model: Model) -> Explanation:
    """The explanation that leads, its aliases at this size, and the rivals that stay.

    Of those that the readings find equally good the coarsest physical part leads, by the rule of
    representatives: two definitions of one error by the order of the kinds, the whole before its part.
    """
    found = rivals(search, model, s.classes)
    first = _leader(s, search, model, found)
    if first is None:
        same = tuple((model.candidates[r.replaces], r.candidate, r.model) for r in found if r.same)
        return Explanation(model, same, tuple(r.model for r in found if not r.same))
    swapped = ((first.candidate, model.candidates[first.replaces], model),) if first.same else ()
    same = tuple(
        (
            first.candidate if r.replaces == first.replaces else model.candidates[r.replaces],
            r.candidate,
            r.model,
        )
        for r in found
        if r.same and r is not first
    )
    rest = tuple(r.model for r in found if not r.same and r is not first)
    return Explanation(first.model, swapped + same, rest if first.same else (model, *rest))


def _leader(s: Study, search: Search, model: Model, found: list[Rival]) -> Rival | None:
    """The rival that goes before the model, if any."""
    words = [r for r in found if r.same and two_words(model.candidates[r.replaces], r.candidate)]
    earlier = [r for r in words if _order(r.candidate) < _order(model.candidates[r.replaces])]
    if earlier:
        return min(earlier, key=lambda r: _order(r.candidate))
    top = score(model, search.problem)
    equal = [r for r in found if r not in words and top - score(r.model, search.problem) < EQUAL]

    def key(m: Model) -> tuple[int, list[tuple[int, bool, int, int]]]:
        return m.freedom, sorted(
            coarseness(c, k, s.description) for c, k in zip(m.candidates, m.sizes(), strict=True)
        )

    best = min(equal, key=lambda r: key(r.model), default=None)
    return best if best is not None and key(best.model) < key(model) else None


def _order(c: Candidate) -> int:
    return registry.kinds().index(c.kind)


# Rival explanations: other candidates in the place of one of the effects, and how they are refused.
#
# Two models are compared by the log-score of each pose, predicted without that pose (leave one group
# out, through the linearised fit), less Schwarz's penalty where they differ in the number of parameters
# (Vuong 1989). Poses are the clusters of the paired test. A rival is also refused where, were it true, it
# would hardly ever lose by so much (Cox 1961). One that is not significantly worse stays in the verdict: it
# is ambiguous, unless no reading of the plan could distinguish the two at the size found: then it is an alias.

LEVEL, RARE = 0.01, 1e-3
ODDS = 100.0
MARGIN = 30.0
"""Rivals whose -ln p is this much below the chosen effect's are refused without a full fit."""
LIKE = 0.1
"""With a calibrated machine, whose model is never exact: share of what an effect explains that a rival may miss."""
SAME, PARALLEL, NESTED = 3.0, 0.1, 1.0
"""Predictions less than 3 standard deviations apart in all readings together are the same to this plan;
at different places also their signatures must agree in 99 % of their squares. Less than one apart, a
model with more parameters is only a longer form."""


@dataclass(frozen=True, eq=False)
class Rival:
    """Another model, and the p-value of the test that it is worse."""

    model: Model
    replaces: int
    p: float
    """One-sided p-value of the paired test that the chosen model scores better."""
    gap: float
    """Distance of the two models' predictions in standard deviations, all readings together."""
    size: float
    """Length of the replaced effect's signature in standard deviations."""
    same: bool
    """Whether no reading of this plan could distinguish the two at the size found: an alias."""

    @property
    def candidate(self) -> Candidate:
        """What stands in the place of the effect."""
        return self.model.candidates[-1]


def rivals(search: Search, model: Model, classes: Sequence[AliasClass], number: int = 6) -> list[Rival]:
    """Models with one effect replaced that the readings do not refuse, best first.

    A candidate with more parameters that contains the effect's signature is no rival but a longer
    form of the same; one that needs more parameters for less (Schwarz odds beyond `ODDS`) is refused.
    """
    longer = {c.representative: set(c.generalisations) for c in classes}
    found: list[Rival] = []
    if search.clock.spent:
        number = FEWEST
        search.clock.leave_out(f"more than {number} rivals of each effect")
    for i, replaced in enumerate(model.candidates):
        reduced = fit_without(model, i, search.predictor, search.problem)
        if not reduced.usable:
            continue
        explained = max(reduced.chi2 - model.chi2, 0.0)
        margin = MARGIN if search.problem.uncertain is None else max(MARGIN, 0.5 * LIKE * explained)
        for f in additions(search, reduced, number, margin):
            new = f.model.candidates[-1]
            if new == replaced or new in longer.get(replaced, set()) or not f.model.usable:
                continue
            rival = compare(search, model, i, f.model, float(np.sqrt(explained)))
            if f.minus_log_p > search.threshold and stays(search, model, rival):
                found.append(rival)
    return sorted(found, key=lambda r: -r.p)


def compare(search: Search, model: Model, i: int, other: Model, size: float) -> Rival:
    """The rival that replaces effect i, whose signature is `size` standard deviations long."""
    assert model.residual is not None and other.residual is not None
    gap = float(np.linalg.norm(model.residual - other.residual))
    one, two = model.candidates[i], other.candidates[-1]
    same = gap < SAME and (two_words(one, two) or gap < PARALLEL * size)
    return Rival(other, i, worse_p(search.problem, model, other), gap, size, same)


def two_words(one: Candidate, other: Candidate) -> bool:
    """Whether two candidates define one error: the same parameters of the same element, applied to larger or smaller
    parts of it."""
    names = [[p.name for p in c.parameters] for c in (one, other)]
    return one.element == other.element and one.legs == other.legs and names[0] == names[1]


def stays(search: Search, model: Model, rival: Rival) -> bool:
    """Whether the readings leave a rival standing."""
    if rival.model.freedom > model.freedom and rival.gap < NESTED:
        return two_words(model.candidates[rival.replaces], rival.candidate)
    if rival.same and two_words(model.candidates[rival.replaces], rival.candidate):
        return True
    beside_calibration = search.problem.uncertain is not None
    if beside_calibration and rival.model.chi2 - model.chi2 < LIKE * rival.size**2:
        return True
    if p_of_loss(model, rival, search.problem.freedom) < RARE:
        return False
    return rival.p > LEVEL and not too_long(search, model, rival)


def p_of_loss(chosen: Model, rival: Rival, freedom: int) -> float:
    """p-value of the loss: were the rival true, how often it would lose by so much (Cox 1961).

    Then the difference of log-likelihoods is normal, mean -gap²/2, standard deviation gap; each side's
    parameters take half of one unit each. In units of what is left unexplained where that is more than noise.
    """
    lost = 0.5 * (rival.model.chi2 - chosen.chi2) - 0.5 * (chosen.freedom - rival.model.freedom)
    spread = max(1.0, chosen.chi2 / max(freedom, 1)) ** 0.5
    gap = max(rival.gap / spread, 1e-9)
    return float(norm.sf((lost / spread**2 + gap**2 / 2) / gap))


def too_long(search: Search, chosen: Model, rival: Rival) -> bool:
    """Whether a model with more parameters has odds against it beyond `ODDS`.

    Each parameter more costs the logarithm of how finely it must be tuned: one part in the effect's
    size in standard deviations, at least Schwarz's square root of the number of readings.
    """
    more = rival.model.freedom - chosen.freedom
    price = max(float(np.log(max(rival.size, 1.0))), 0.5 * float(np.log(len(search.problem))))
    odds = 0.5 * (rival.model.chi2 - chosen.chi2) + more * price
    return bool(more > 0 and odds > np.log(ODDS))


def worse_p(problem: Problem, chosen: Model, other: Model) -> float:
    """One-sided p-value of `other` being worse than `chosen`; small: `other` is refused."""
    difference = group_scores(problem, chosen) - group_scores(problem, other)
    penalty = 0.5 * np.log(len(problem)) * (other.freedom - chosen.freedom)
    n = len(difference)
    spread = float(np.std(difference, ddof=1) * np.sqrt(n)) if n > 1 else np.inf
    if spread < 1e-9:
        return 0.5
    return float(student.sf((float(difference.sum()) + penalty) / spread, n - 1))


def group_scores(problem: Problem, model: Model) -> Floats:
    """(G,) log-score of each pose (on a ramp, each cluster) predicted without it; scores without the part that all models share."""
    assert model.residual is not None and model.jacobian is not None
    groups = problem.experiment.clusters[problem.index[0]]
    inverse = np.linalg.pinv(model.jacobian.T @ model.jacobian, rcond=1e-12, hermitian=True)
    out = []
    for g in np.unique(groups):
        here = np.flatnonzero(groups == g)
        j = model.jacobian[here]
        left = np.eye(len(here)) - j @ inverse @ j.T
        r = np.linalg.lstsq(left, model.residual[here], rcond=1e-10)[0]
        out.append(-0.5 * float(r @ r))
    return np.array(out)

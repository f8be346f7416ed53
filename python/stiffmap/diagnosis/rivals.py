"""Rival explanations: other candidates in the place of one of the effects, and how they are refused.

Two models are compared by the log-score of each pose, predicted without that pose (leave one group
out, through the linearised fit), less Schwarz's penalty where they differ in the number of parameters
(Vuong 1989). Poses are the clusters of the paired test. A rival that is not significantly worse stays
in the verdict: it is ambiguous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from stiffmap.diagnosis.alias import AliasClass
from stiffmap.diagnosis.fit import fit
from stiffmap.diagnosis.model import Model
from stiffmap.diagnosis.search import Search, additions, score
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.problem import Problem

LEVEL = 0.01
ODDS, RATIO = 100.0, 1e3
MARGIN = 30.0
"""Rivals whose surprise is this much below the chosen effect's are refused without a full fit."""


@dataclass(frozen=True, eq=False)
class Rival:
    """Another model, and the chance that it only looks worse."""

    model: Model
    replaces: int
    p: float
    """One-sided p-value of the paired test that the chosen model scores better."""


def rivals(search: Search, model: Model, classes: Sequence[AliasClass], number: int = 6) -> list[Rival]:
    """Models with one effect replaced that the readings do not refuse at `LEVEL`, best first.

    A candidate with more parameters that contains the effect's signature is no rival but a longer
    form of the same; one that needs more parameters for less (Schwarz odds beyond `ODDS`) is refused.
    """
    longer = {c.representative: set(c.generalisations) for c in classes}
    found: list[Rival] = []
    for i, replaced in enumerate(model.candidates):
        reduced = fit(model.without(i), search.predictor, search.problem)
        for f in additions(search, reduced, number, MARGIN):
            new = f.model.candidates[-1]
            if new == replaced or new in longer.get(replaced, set()) or not np.isfinite(f.model.chi2):
                continue
            if overwhelmed(search, model, f.model):
                continue
            p = worse_p(search.problem, model, f.model)
            if p > LEVEL and f.surprise > search.threshold and not too_long(search, model, f.model):
                found.append(Rival(f.model, i, p))
    return sorted(found, key=lambda r: -r.p)


def overwhelmed(search: Search, chosen: Model, other: Model) -> bool:
    """Whether the score is beyond what the truth could lose by chance: were `other` true, a likelihood
    ratio of r against it would have a chance of at most 1/r. Divided by what is left unexplained."""
    lost = score(chosen, search.problem) - score(other, search.problem)
    return bool(lost / max(1.0, chosen.chi2 / max(search.problem.freedom, 1)) > np.log(RATIO))


def too_long(search: Search, chosen: Model, other: Model) -> bool:
    """Whether a model with more parameters has Schwarz odds against it beyond `ODDS`."""
    odds = score(chosen, search.problem) - score(other, search.problem)
    return bool(len(other.values) > len(chosen.values) and odds > np.log(ODDS))


def worse_p(problem: Problem, chosen: Model, other: Model) -> float:
    """One-sided p-value of `other` being worse than `chosen`; small: `other` is refused."""
    difference = group_scores(problem, chosen) - group_scores(problem, other)
    penalty = 0.5 * np.log(len(problem)) * (len(other.values) - len(chosen.values))
    n = len(difference)
    spread = float(np.std(difference, ddof=1) * np.sqrt(n)) if n > 1 else np.inf
    if spread < 1e-9:
        return 0.5
    return float(student.sf((float(difference.sum()) + penalty) / spread, n - 1))


def group_scores(problem: Problem, model: Model) -> Floats:
    """(G,) log-score of each pose predicted without it; scores without the part that all models share."""
    assert model.residual is not None and model.jacobian is not None
    groups = problem.groups
    inverse = np.linalg.pinv(model.jacobian.T @ model.jacobian, rcond=1e-12, hermitian=True)
    out = []
    for g in np.unique(groups):
        here = np.flatnonzero(groups == g)
        j = model.jacobian[here]
        left = np.eye(len(here)) - j @ inverse @ j.T
        r = np.linalg.lstsq(left, model.residual[here], rcond=1e-10)[0]
        out.append(-0.5 * float(r @ r))
    return np.array(out)

"""Effects must explain more than noise as it is, not only more than noise as it is declared.

Noise that is larger than declared, or that goes on from one row to the next, is explained in part by whatever is tried.
What is left of the readings says how large it is.
"""

from __future__ import annotations

from stiffmap.experiment.noise.as_left import AsLeft, as_left
from stiffmap.identification.diagnosis.fitting.fit import fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.selection import minus_log_p_of
from stiffmap.identification.diagnosis.search.study import Finding
from stiffmap.model.effects import get


def noise_left(finding: Finding, model: Model) -> AsLeft:
    """What a model leaves, as noise."""
    assert model.residual is not None
    return as_left(finding.search.problem, model.residual, model.freedom)


def above_noise(finding: Finding, model: Model) -> tuple[Model, tuple[str, ...]]:
    """The model without effects that explain no more than such noise would, the least first, and why.

    Correlation along time counts for what goes with the order of the rows; poses and loads do not follow it.
    """
    refused: list[str] = []
    search = finding.search
    while model.candidates:
        noise = noise_left(finding, model)
        if noise.widening <= 1.0:
            break
        trials = [
            fit_without(model, i, search.predictor, search.problem) for i in range(len(model.candidates))
        ]
        worth = [
            minus_log_p_of((t.chi2 - model.chi2) / _variance(noise, c.kind), n)
            for t, c, n in zip(trials, model.candidates, model.sizes(), strict=True)
        ]
        least = min(range(len(worth)), key=worth.__getitem__)
        if worth[least] >= search.threshold or not trials[least].usable:
            break
        told = "; ".join(noise.sentences()) or "noise"
        refused.append(f"{model.candidates[least]}: no more than noise as it is ({told})")
        model = trials[least]
    return model, tuple(refused)


def _variance(noise: AsLeft, kind: str) -> float:
    """Of noise relative to what is declared, for an effect of a kind."""
    own = max(noise.ratio, 1.0) if noise.other else 1.0
    in_time = "order" in get(kind).needs
    return max(noise.widening, 1.0) ** 2 if in_time else own**2

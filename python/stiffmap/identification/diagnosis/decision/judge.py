"""From what is left to a verdict: effects that an unexplained residual makes untrustworthy are withdrawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.experiment.noise.checks import Check, checks
from stiffmap.identification.diagnosis.decision.patterns import Pattern, patterns
from stiffmap.identification.diagnosis.decision.stability import SHARE, explained, steady
from stiffmap.identification.diagnosis.fitting.fit import evaluate, fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.selection import Search
from stiffmap.identification.diagnosis.search.study import Finding, Study, alone, search_on

VIOLATED = 1e-6
"""p-value below which a model-free check, applied to what the effects leave, refuses the verdict."""


def judge(s: Study, finding: Finding) -> tuple[Finding, str, list[Pattern]]:
    """What is named in the end, the verdict, and what is left.

    Where an unexplained residual remains, an effect is named only if it explains more than the residual is, if all
    together explain `SHARE` of the misfit, and if each is the same in all halves of the data.
    """
    s.clock.say("structure in what is left")
    left = unexplained(s, finding)
    if not left:
        return finding, "effects" if finding.model.candidates else "none", left
    model = outweighing(finding.search, finding.model)
    if model.candidates:
        share = explained(finding.selection.null, model, finding.search.problem.freedom)
        if share >= SHARE and all(steady(finding.search.problem, model)):
            finding = with_model(finding, model)
            return finding, "effects+unattributed", unexplained(s, finding)
    bare = _bare(s, finding)
    return bare, "unattributed", unexplained(s, bare) or left


def outweighing(search: Search, model: Model) -> Model:
    """The model without effects that explain less than what it leaves beyond noise, the least first."""
    while model.candidates:
        trials = [
            fit_without(model, i, search.predictor, search.problem) for i in range(len(model.candidates))
        ]
        least = min(trials, key=lambda t: t.chi2)
        if not least.usable:
            return model
        if least.chi2 - model.chi2 >= model.chi2 - search.problem.freedom:
            return model
        model = least
    return model


def with_model(finding: Finding, model: Model) -> Finding:
    """The finding with other effects."""
    return replace(finding, selection=replace(finding.selection, model=model))


def _bare(s: Study, finding: Finding) -> Finding:
    """The declared machine on the rows that stand alone from nothing but their neighbours."""
    e = s.experiment
    out = alone(s, e.reading - s.plan.base)
    search = search_on(s, ~out, finding.search.finalists)
    null = evaluate(Model(), search.predictor, search.problem)
    return Finding(replace(finding.selection, model=null, null=null), search, out)


def unexplained(s: Study, finding: Finding) -> list[Pattern]:
    """Patterns and violated checks in what the effects leave."""
    model = finding.model
    assert model.residual is not None
    found = patterns(finding.search.problem, model.residual, model.tangent())
    for check in after_checks(s, finding):
        if check.contrasts and check.p < VIOLATED:
            found.append(Pattern("all axes", f"{check.name} violated ({check.meaning})", check.p, np.nan))
    return found


def after_checks(s: Study, finding: Finding) -> list[Check]:
    """Model-free checks of the residual, of what the calibrated numbers leave of it where there are some."""
    residual = s.experiment.reading - s.predictor(finding.model.terms())
    if s.layer is not None:
        residual = residual - s.layer.part(s.problem_of(~finding.outliers), residual)
    return checks(s.experiment, residual, s.noise.sigma, ~finding.outliers)

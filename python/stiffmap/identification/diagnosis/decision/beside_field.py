"""Where an unexplained residual remains, an effect must gain with a smooth field that does not depend on the machine in the model.

What is left over is seldom noise: an effect with a few free parameters takes some of it away wherever it is smooth. The
effect that is there explains in its few directions what the field needs many for (docs/theory.md I3).
"""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.level import Mask
from stiffmap.identification.calibration.calibrator import pose_labels
from stiffmap.identification.calibration.claims import BesideField
from stiffmap.identification.calibration.groups import STRONG
from stiffmap.identification.calibration.wording import odds
from stiffmap.identification.diagnosis.fitting.fit import evaluate, fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.study import Finding, Study, search_on


def standing(s: Study, finding: Finding) -> tuple[Model, tuple[str, ...]]:
    """The model without effects that gain less than their price with the field in the model, the least first, and why."""
    model, search = finding.model, finding.search
    refused: list[str] = []
    price = STRONG + float(np.log(max(search.effective_trials, 1.0)))
    if not model.candidates or s.clock.over:
        return model, ()
    s.clock.say("a smooth field that does not depend on the machine")
    left = s.free(s.experiment.reading - s.plan.base, finding.outliers)
    now = log_evidence(s, model, finding.outliers, left)
    while model.candidates:
        trials = [
            fit_without(model, i, search.predictor, search.problem) for i in range(len(model.candidates))
        ]
        without = [log_evidence(s, t, finding.outliers, left) if t.usable else -np.inf for t in trials]
        least = int(np.argmax(without))
        gain = now - without[least]
        if gain >= price:
            break
        refused.append(
            f"{model.candidates[least]}: a smooth field that does not depend on the machine explains as much "
            f"(odds {odds(gain - price + STRONG)} with the field in the model)"
        )
        model, now = trials[least], without[least]
    return model, tuple(refused)


def log_evidence(s: Study, model: Model, out: Mask, left: Floats) -> float:
    """Of effects with a normal prior of their own size on each parameter, jointly with uncertain numbers, a smooth field as large
    as `left` (n, c) and a floor per pose."""
    search = search_on(s, ~out, 1)
    problem = search.problem.exact
    model = evaluate(model, s.predictor, problem)
    assert model.residual is not None and model.jacobian is not None
    residual = model.residual
    columns = np.zeros((len(problem), 0)) if s.layer is None else problem.white(s.layer.columns)
    if model.candidates:
        null = np.array([float(p.null or 0.0) / p.scale for c in model.candidates for p in c.parameters])
        sized = -model.jacobian * np.abs(model.values - null)
        residual = residual + sized @ np.sign(model.values - null)  # as seen from without the effects
        columns = np.hstack([columns, sized])
    field = BesideField.of(problem, columns, residual, pose_labels(problem), left)
    return field.log_evidence(np.ones(columns.shape[1]))

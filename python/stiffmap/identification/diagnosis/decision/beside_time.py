"""Effects must explain what no smooth course over time explains: creep, warming and drift do not depend on the machine."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment.noise.over_time import SELDOM, courses
from stiffmap.experiment.noise.whitening import basis
from stiffmap.identification.diagnosis.fitting.fit import fit_without
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.selection import minus_log_p_of
from stiffmap.identification.diagnosis.search.study import Finding
from stiffmap.model.effects import get


def beside_time(finding: Finding, model: Model) -> tuple[Model, tuple[str, ...]]:
    """The model without effects that are not significant jointly with smooth courses over time, where the readings go
    with time (`SELDOM`), and why; effects that are a course over time themselves are not tested."""
    search = finding.search
    q = courses(search.problem)
    refused: list[str] = []
    while q.shape[1]:
        rivals: list[tuple[float, int, Model]] = []
        for i, c in enumerate(model.candidates):
            if "order" in get(c.kind).needs:
                continue
            less = fit_without(model, i, search.predictor, search.problem)
            if less.residual is None or not less.usable or not _moves(less.residual, q):
                continue
            worth = _worth(model, i, less.residual, q)
            if worth < search.threshold:
                rivals.append((worth, i, less))
        if not rivals:
            break
        _, i, less = min(rivals, key=lambda r: r[:2])
        refused.append(
            f"{model.candidates[i]}: a smooth course over time (drift, creep or warming) explains as much"
        )
        model = less
    return model, tuple(refused)


def _moves(residual: Floats, q: Floats) -> bool:
    """Whether what the readings are without an effect goes with time at all; courses that chance may show are no rival."""
    seen = q.T @ residual
    return bool(minus_log_p_of(float(seen @ seen), q.shape[1]) >= -np.log(SELDOM))


def _worth(model: Model, i: int, without: Floats, q: Floats) -> float:
    """-ln p of an effect jointly with the courses, the other effects refitted to first order; `without`: the residual of the
    fit that lacks it."""
    assert model.residual is not None and model.jacobian is not None
    own = model.parts()[i]
    others = [k for k in range(model.jacobian.shape[1]) if not own.start <= k < own.stop]

    def left(residual: Floats, columns: Floats) -> float:
        both = basis(np.hstack([q, columns]))
        rest = residual - both @ (both.T @ residual)
        return float(rest @ rest)

    drop = left(without, model.jacobian[:, others]) - left(model.residual, model.jacobian)
    return minus_log_p_of(drop, model.sizes()[i])

"""Frames and tools where the machine stands, not where it is commanded: by a first calibration of its declared numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.noise.whitening import LinearProblem, fitted
from stiffmap.experiment.prediction.predict import FAR, Predictor
from stiffmap.identification.numbers.certificate import Tolerances, certified
from stiffmap.identification.numbers.sensitivity import predicted, sensitivity
from stiffmap.identification.numbers.unknowns import unknowns

ROUNDS = 5
"""Gauss-Newton steps, each with the noise that the last one left."""


def registered(predictor: Predictor, tolerances: Tolerances | None, exclude: Sequence[str]) -> Predictor:
    """The predictor with frames and tools of best fit where the machine stands with its uncertain numbers fitted; itself where no frame
    or tool is found by the readings, or the machine stands as commanded."""
    e, base = predictor.experiment, predictor()
    every = unknowns(predictor.machine.description, e, certified(tolerances, e))
    uncertain = [u for u in every if u.group not in exclude]
    if not predictor.is_sighted or not uncertain:
        return predictor
    noise, aside = without_suspects(e, base)
    s = sensitivity(predictor, uncertain)
    values, shown = np.zeros(len(s.unknowns)), base
    for _ in range(ROUNDS):
        problem = LinearProblem.of(e, noise.sigma, shown, ~aside)
        columns = problem.white(np.nan_to_num(s.columns))
        left = problem.residual(shown) + columns @ values
        size = max(1.0, 1.4826 * float(np.median(np.abs(left - columns @ values))))
        known = np.vstack([columns / size, np.eye(len(values))])
        values = fitted(known, np.append(left / size, np.zeros(len(values))))[0]
        moved = predicted(predictor, s.unknowns, values)
        if not np.isfinite(moved[problem.index]).all():
            return predictor
        shown = moved
    return predictor.registered(shown) if np.nanmax(np.abs(shown)) > FAR else predictor

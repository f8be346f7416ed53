"""Frames and tools where the machine stands, not where it is commanded: by a first calibration of its declared numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.noise.whitening import LinearProblem, fitted
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.numbers.certificate import Tolerances
from stiffmap.identification.numbers.sensitivity import predicted, sensitivity
from stiffmap.identification.numbers.unknowns import uncertain

ROUNDS = 5
"""Gauss-Newton steps, each with the noise that the last one left."""


def registered(predictor: Predictor, tolerances: Tolerances | None, exclude: Sequence[str]) -> Predictor:
    """The predictor with frames and tools of best fit where the machine stands with its uncertain numbers fitted; itself where no frame
    or tool is found by the readings, or the machine stands as commanded. Raises StiffmapError for readings that cannot be compared."""
    e, base = predictor.experiment, predictor()
    refuse(e, base)
    if not predictor.is_sighted:
        return predictor
    noise, aside = without_suspects(e, base)
    s = sensitivity(predictor, uncertain(predictor.machine.description, e, tolerances, exclude))
    values, shown = np.zeros(len(s.unknowns)), base
    for _ in range(ROUNDS):
        problem = LinearProblem.of(e, noise.sigma, shown, ~aside)
        columns, left = problem.white(np.nan_to_num(s.columns)), problem.residual(shown)
        size = max(1.0, 1.4826 * float(np.median(np.abs(left))))
        whole = np.vstack([columns / size, np.eye(len(values))])
        wanted = np.append((left + columns @ values) / size, np.zeros(len(values)))
        values = fitted(whole, wanted)[0]
        moved = predicted(predictor, s.unknowns, values)
        if not np.isfinite(moved[problem.index]).all():
            return predictor
        shown = moved
    return predictor.registered(shown)

"""What a machine's prediction leaves of readings that it was not fitted to."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.comparison.summary import Summary, summary
from stiffmap.experiment.experiment import Experiment, Mask
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.solve.machine import Machine


def left_by(machine: Machine, experiment: Experiment, rows: Mask | None = None) -> tuple[Summary, Summary]:
    """Sizes of the readings, and of what they differ by from the machine's prediction, m and rad; of `rows` (n,) alone.

    Frames and zeros that the experiment calls unknown are fitted to each, by all rows. To first order the second is the
    error at commands that cancel the prediction. Raises StiffmapError for readings that cannot be used.
    """
    predictor = Predictor(machine, experiment)
    e, expected = predictor.experiment, predictor()
    refuse(e, expected)
    sigma = noise_of(e).sigma
    problem = Problem.of(e, sigma, expected)
    bare = (r - nuisance_part(problem, r) for r in (e.reading, e.reading - expected))
    kept = np.ones(len(e), bool) if rows is None else rows
    before, after = (summary(np.where(kept[:, None], r, np.nan), sigma, e.channels) for r in bare)
    return before, after

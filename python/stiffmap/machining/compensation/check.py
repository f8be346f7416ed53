"""Whether compensation would help: readings that no fit saw, as they are and less what the corrected machine says of them."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy as np

from stiffmap.experiment.calls import as_experiment
from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.comparison.residual import Summary, summary
from stiffmap.experiment.experiment import Experiment, Mask
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import LinearProblem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.validity import beyond
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.validity import Validity

Sizes = tuple[Summary, Summary]


@dataclass(frozen=True, eq=False)
class CompensationCheck:
    """Sizes of n readings as measured and as compensation would leave them, m or rad."""

    whole: Sizes
    """Of all readings: before, after."""
    beyond: Mask | None
    """(n,) rows beyond what the machine was calibrated by; None: it was not calibrated."""
    there: Sizes | None
    """Of those rows alone, where they are some but not all."""
    validity: Validity | None
    """What the machine's file promises; None: it was not calibrated."""

    @property
    def worse(self) -> bool:
        """Whether compensation would enlarge the error, of all readings or of those beyond the calibration."""
        parts = (self.whole,) if self.there is None else (self.whole, self.there)
        return any(after.size[0] > before.size[0] for before, after in parts)


@takes_machine
def check_compensation(machine: Machine, experiment: Experiment | str | PathLike[str]) -> CompensationCheck:
    """Check a corrected machine against an experiment (object, folder or file) that no fit saw.

    Frames and zeros that the experiment calls unknown are fitted to both sizes. Raises StiffmapError for readings that
    cannot be used.
    """
    e = Predictor(machine, as_experiment(experiment)).experiment
    far = beyond(machine, e)
    some = far is not None and far.any() and not far.all()
    there = prediction_error(machine, e, far) if some else None
    return CompensationCheck(prediction_error(machine, e), far, there, Validity.of_machine(machine))


def prediction_error(
    machine: Machine, experiment: Experiment, rows: Mask | None = None
) -> tuple[Summary, Summary]:
    """Sizes of the readings, and of what they differ by from the machine's prediction, m and rad; of `rows` (n,) alone.

    Frames and zeros that the experiment calls unknown are fitted to each, by all rows. To first order the second is the
    error at commands that cancel the prediction. Raises StiffmapError for readings that cannot be used.
    """
    predictor = Predictor(machine, experiment)
    e, expected = predictor.experiment, predictor()
    refuse(e, expected)
    sigma = noise_of(e).sigma
    problem = LinearProblem.of(e, sigma, expected)
    bare = (r - nuisance_part(problem, r) for r in (e.reading, e.reading - expected))
    kept = np.ones(len(e), bool) if rows is None else rows
    before, after = (summary(np.where(kept[:, None], r, np.nan), sigma, e.channels) for r in bare)
    return before, after

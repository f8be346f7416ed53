"""Whether compensation would help: readings that no fit saw, as they are and less what the corrected machine says of them."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.calls import as_experiment
from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.comparison.residual import Summary, summary
from stiffmap.experiment.experiment import Experiment
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
    predictor = Predictor(machine, as_experiment(experiment))
    e, expected = predictor.experiment, predictor()
    refuse(e, expected)
    sigma = noise_of(e).sigma
    problem = LinearProblem.of(e, sigma, expected)
    # to first order the second is the error at commands that cancel the prediction
    bare = [r - nuisance_part(problem, r) for r in (e.reading, e.reading - expected)]

    def sizes(rows: Mask) -> Sizes:
        before, after = (summary(np.where(rows[:, None], r, np.nan), sigma, e.channels) for r in bare)
        return before, after

    far = beyond(machine, e)
    there = sizes(far) if far is not None and far.any() and not far.all() else None
    return CompensationCheck(sizes(np.ones(len(e), bool)), far, there, Validity.of_machine(machine))

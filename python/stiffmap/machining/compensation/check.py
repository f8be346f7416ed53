"""Whether compensation would help: readings that no fit saw, as they are and less what the corrected machine says of them."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

from stiffmap.experiment.calls import as_experiment
from stiffmap.experiment.comparison.prediction_error import left_by
from stiffmap.experiment.comparison.summary import Summary
from stiffmap.experiment.experiment import Experiment, Mask
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
    return CompensationCheck(
        left_by(machine, e), far, left_by(machine, e, far) if some else None, Validity.of_machine(machine)
    )

"""`calibrate`: every uncertain number of a machine from readings, at once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from os import PathLike

import numpy as np

from stiffmap.common.broadcasting import whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.one_thread import on_one_thread
from stiffmap.experiment.comparison.limitations import refuse
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.calibration.calibrator import Calibrator
from stiffmap.identification.calibration.certificate import certified
from stiffmap.identification.calibration.conclude import conclude
from stiffmap.identification.calibration.defaults import Tolerances
from stiffmap.identification.calibration.model import Progress
from stiffmap.identification.calibration.result import Calibration
from stiffmap.identification.calibration.unknowns import GROUPS, unknowns
from stiffmap.solve.machine import Machine, load_machine


@on_one_thread
def calibrate(
    machine: Machine | str | PathLike[str],
    experiment: Experiment | str | PathLike[str],
    *,
    tolerances: Tolerances | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """What a machine's uncertain numbers are, and which of them the readings can determine.

    Parameters
    ----------
    machine
        Declared machine, the name of a shipped one, or a machine file.
    experiment
        An experiment, its folder or its YAML file.
    tolerances
        Standard uncertainties per class where the machine file gives none.
    exclude
        Groups that are left out (`GROUPS`): what is known to be right.
    seed
        Of the folds.
    time_limit
        Seconds after which no new step begins; the answer is then the best so far, and says so.
    progress
        Called with what is being tried, its number, and of how many.

    Raises
    ------
    StiffmapError
        For files that cannot be used, poses out of reach, an unknown noise or group.
        docs/calibration.md describes the method.
    """
    whole_number(seed, "seed", 0)
    machine = machine if isinstance(machine, Machine) else load_machine(machine)
    data = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    for name in exclude:
        if name not in GROUPS:
            raise StiffmapError(f"calibration: unknown group '{name}'; there are: {', '.join(GROUPS)}")
    predictor = Predictor(machine, data, threads=threads)
    refuse(predictor.experiment, predictor())
    wanted = [
        p
        for p in unknowns(machine.description, predictor.experiment, certified(tolerances, data))
        if p.group not in exclude
    ]
    until = time.monotonic() + time_limit if time_limit else np.inf
    return conclude(Calibrator.of(predictor, wanted, until, progress), seed)

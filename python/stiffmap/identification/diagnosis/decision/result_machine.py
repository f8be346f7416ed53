"""The machine file that a diagnosis gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.experiment.channels import metres
from stiffmap.experiment.experiment import Floats, Integers, Mask
from stiffmap.identification.calibration.validity import covered
from stiffmap.identification.diagnosis.decision.cross_validation import HeldOut
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.study import Study
from stiffmap.solve.machine import Machine


def result_machine(s: Study, model: Model, machine: Machine, keep: Mask, held: HeldOut | None) -> Machine:
    """The corrected machine, whose file says what it has from which experiment, what the readings in `keep` (n,)
    covered, and what those that no fit saw differed by."""
    if machine is s.predictor.machine:
        return machine
    d = machine.description
    added = "; ".join(f"{c}, from experiment {s.experiment.name}" for c in model.candidates)
    source = f"{d.source} Effects added by a diagnosis: {added}." if added else d.source
    if s.layer is not None:
        source = f"{source} Numbers calibrated by experiment {s.experiment.name}."
    declared = None if d.declared is None else replace(d.declared, source=source.strip())
    valid = covered(s.predictor.machine, s.experiment, keep)
    if held:
        error, unit = held.after.size
        columns = metres(s.experiment.channels) == (unit == "m")
        u = u_of_rms(held.residual[:, columns], s.experiment.groups)
        valid = replace(valid, error=error, error_u=u, unit=unit)
    return valid.kept_by(Machine(replace(d, source=source.strip(), declared=declared)))


def u_of_rms(residual: Floats, groups: Integers) -> float:
    """Standard uncertainty of the rms of residuals (n, c), by the scatter of the mean squares of poses `groups` (n,)."""
    squares = np.array(
        [
            np.nanmean(residual[groups == g] ** 2)
            for g in np.unique(groups)
            if np.isfinite(residual[groups == g]).any()
        ]
    )
    if len(squares) < 2:
        return 0.0
    return float(squares.std(ddof=1) / np.sqrt(len(squares)) / (2.0 * np.sqrt(squares.mean()) or 1.0))

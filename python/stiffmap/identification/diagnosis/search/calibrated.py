"""The calibration below the effects: declared numbers are uncertain, and effects come on top of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.fingerprints import digest
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.level import Mask, Noise
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration import Calibration, Calibrator
from stiffmap.identification.calibration.statistics import Sums


@dataclass(frozen=True, eq=False)
class Layer:
    """Uncertain numbers of a machine under a plan, and what is known of the noise above them."""

    columns: Floats
    """(n, c, p) change of the readings per standard uncertainty of each."""
    bent: Floats
    """(n, c) what the calibrated prediction has beyond the linear one; taken out of the readings."""
    noise: Noise
    """With the model-form floor in it."""
    out: Mask
    """(n,) outliers of the calibration."""
    calibration: Calibration
    own: tuple[int, ...] = ()
    """Unknowns that belong to one set-up alone."""

    @staticmethod
    def of(found: Calibrator, calibration: Calibration, floor: float = 0.0) -> Layer:
        """The layer of a calibration; `floor` is the variance of what no model explains, in noise variances."""
        s, fit = found.sensitivity, found.fit
        bent = fit.prediction - s.base - s.columns @ fit.values
        noise = raised(found.noise, floor)
        own = tuple(i for i, u in enumerate(s.unknowns) if u.setup)
        return Layer(s.columns, np.nan_to_num(bent), noise, found.out, calibration, own)

    def narrowed(self, direction: Floats, share: float) -> Layer:
        """The same where the uncertain numbers have a `share` of their uncertainty along a direction (p,)."""
        d = direction / np.linalg.norm(direction)
        return replace(self, columns=self.columns - (1.0 - share) * np.multiply.outer(self.columns @ d, d))

    @property
    def digest(self) -> str:
        """Of the uncertain numbers, for what is kept per plan."""
        return digest(self.columns)

    def straight(self, experiment: Experiment) -> Experiment:
        """The readings less what is not linear in the uncertain numbers."""
        return experiment.with_readings(experiment.reading - self.bent)

    def part(self, problem: Problem, residual: Floats, columns: Floats | None = None) -> Floats:
        """(n, c) what the uncertain numbers (of `columns` (n, c, p); default: all) say best of a residual, from the rows
        of the problem."""
        bare, columns = problem.exact, self.columns if columns is None else columns
        white = bare.white(columns)
        return np.asarray(columns @ Sums.of(white, bare.white(np.nan_to_num(residual))).estimate)

    def own_part(self, problem: Problem, residual: Floats) -> Floats:
        """(n, c) what unknowns of single set-ups say of a residual, from the rows of the problem."""
        return self.part(problem, residual, self.columns[..., self.own])


def raised(noise: Noise, floor: float) -> Noise:
    """The noise with what no model explains added, `floor` noise variances."""
    factor = float(np.sqrt(1.0 + floor))
    return replace(noise, floor=noise.floor * factor, sigma=noise.sigma * factor)

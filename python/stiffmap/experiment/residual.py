"""Residual of an experiment against a machine, with noise floor, lack of fit, outliers and checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from stiffmap.experiment.checks import Check, checks
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise import Mask, Noise, noise_of
from stiffmap.experiment.outliers import suspects
from stiffmap.experiment.predict import predict
from stiffmap.experiment.summary import Summary, summary
from stiffmap.machine import Machine


@dataclass(frozen=True, eq=False)
class Residual:
    """Reading minus prediction, SI, base axes."""

    experiment: Experiment
    prediction: Floats
    """(n, 6)."""
    values: Floats
    """(n, 6) NaN where nothing was read."""
    noise: Noise
    set_aside: Mask
    """(n,) rows that contradict their repeats or stand alone; not in `summary` nor `lack_of_fit`."""
    summary: Summary
    lack_of_fit: float
    """Chance of a residual this large if the machine were as declared."""
    groups_off: int
    """Poses whose mean residual alone is beyond noise (chance below 1e-3 for any of them)."""
    checks: list[Check]

    def worst(self, number: int = 10) -> list[tuple[str, float]]:
        """Ids and residual lengths (m) of the worst rows, linear axes."""
        size = np.sqrt(np.nansum(self.values[:, :3] ** 2, axis=1))
        return [(self.experiment.ids[i], float(size[i])) for i in np.argsort(-size)[:number]]


def residual(machine: Machine, experiment: Experiment) -> Residual:
    """Residual of every reading; raises StiffmapError for unknown points or an unknown noise."""
    prediction = predict(machine, experiment)
    values = experiment.reading - prediction
    rough = noise_of(experiment)
    out = suspects(experiment, values, rough.sigma)
    noise = noise_of(experiment, ~out)
    kept = np.where(out[:, None], np.nan, values)
    z = kept / noise.sigma
    total, number = float(np.nansum(z**2)), int(np.isfinite(z).sum())
    return Residual(
        experiment,
        prediction,
        values,
        noise,
        out,
        summary(kept, noise.sigma),
        float(chi2.sf(total, number)),
        _groups_off(experiment, z),
        checks(experiment, experiment.reading, noise.sigma, ~out),
    )


def _groups_off(experiment: Experiment, z: Floats) -> int:
    off = 0
    number = int(experiment.groups.max()) + 1
    for g in range(number):
        here = z[experiment.groups == g]
        count = np.isfinite(here).sum(axis=0)
        means = np.nansum(here, axis=0)[count > 0] / np.sqrt(count[count > 0])
        off += bool(count.any() and chi2.sf(float(np.sum(means**2)), len(means)) < 1e-3 / number)
    return off

"""Virtual experiments: a plan, a machine with effects, and noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.comparison.limitations import refuse_unreachable
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine, takes_machine

UNKNOWN = 1e-4
"""m, rad: standard deviation of an unknown frame, tool point or zero."""


@takes_machine
def simulate(
    machine: Machine,
    plan: Experiment,
    effects: Sequence[AppliedEffect] = (),
    *,
    seed: int = 0,
    outliers: float = 0.0,
) -> Experiment:
    """The plan's readings on a machine that has `effects`, with noise of the declared size.

    Zeros that readings share, and the frames and zeros that the plan calls unknown, are drawn too.

    outliers
        Share of rows that are off by 5 to 20 standard deviations.

    Raises StiffmapError where no noise is declared or the machine cannot be solved.
    """
    if np.isnan(plan.sigma[plan.read]).any():
        raise StiffmapError(f"{plan.name}: a virtual experiment needs a declared noise for every axis read")
    predictor = Predictor(machine, plan)
    exact = predictor(tuple(effects))
    plan = predictor.experiment
    refuse_unreachable(plan, exact)
    rng = random_numbers(seed)
    reading = exact + np.nan_to_num(plan.sigma) * rng.standard_normal(exact.shape)
    reading = reading + _zeros(plan, rng) + _unknown(plan, predictor(), rng)
    wild = rng.random(len(plan)) < outliers
    size = rng.uniform(5, 20, (int(wild.sum()), 1)) * plan.sigma[wild]
    reading[wild] += rng.choice([-1, 1], (int(wild.sum()), exact.shape[1])) * size
    return replace(plan, reading=np.where(plan.read, reading, np.nan), joints=None, other_joints=None)


def _zeros(plan: Experiment, rng: np.random.Generator) -> Floats:
    zeros = rng.standard_normal((int(plan.groups.max()) + 1, len(plan.channels))) * plan.zeros
    return np.asarray(zeros[plan.groups])


def _unknown(plan: Experiment, base: Floats, rng: np.random.Generator) -> Floats:
    columns = nuisance_columns(plan, base)
    return np.asarray(columns @ (UNKNOWN * rng.standard_normal(columns.shape[-1])))

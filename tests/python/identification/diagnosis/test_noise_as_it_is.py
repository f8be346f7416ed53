"""Noise that goes on from one row to the next is no drift of the sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor
from stiffmap.experiment.virtual.plans import load_set, plan_of_poses, random_poses

SIGMA = 2e-6


def correlated(seed: int) -> tuple[sm.Machine, Experiment]:
    """The machine as declared under noise of AR(1) with 0.7 along the order of the rows, of the declared size."""
    machine = sm.load_machine("tripteron")
    poses, loads = random_poses(machine, 8, 1), load_set("axes", (100.0,))
    plan = plan_of_poses(machine, "deflection", poses, loads, noise=SIGMA)
    rng = np.random.default_rng(seed)
    z = np.zeros((len(plan), 3))
    z[0] = rng.standard_normal(3)
    for i in range(1, len(z)):
        z[i] = 0.7 * z[i - 1] + np.sqrt(0.51) * rng.standard_normal(3)
    reading = Predictor(machine, plan)()
    reading[:, :3] += SIGMA * z
    return machine, replace(plan.with_readings(reading), order=np.arange(len(plan), dtype=float))


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_noise_along_time_is_no_drift(seed: int) -> None:
    d = sm.diagnose(*correlated(seed), cross_validate=False)
    assert not d.effects

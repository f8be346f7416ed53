"""A number that is far off is named with many readings as with few, and large pulls are no tolerance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.identification.calibration import Tolerances, calibrate, unknowns
from stiffmap.identification.calibration.model import predicted
from stiffmap.identification.calibration.pulls import pulls
from stiffmap.identification.calibration.statistics import Sums


def twin(name: str, poses: int, off: dict[str, float], small: float = 0.5) -> tuple[sm.Machine, Experiment]:
    """Every number off by a draw, some by so many standard uncertainties, and a wave of one noise floor below all."""
    machine = sm.load_machine(name)
    plan = replace(random_plan(machine, "position", poses=poses, repeats=1, seed=0), frame="unknown")
    p = Predictor(machine, plan)
    names = unknowns(machine.description, p.experiment)
    rng = np.random.default_rng(0)
    t = small * rng.standard_normal(len(names)) * np.array([not u.of_instrument for u in names])
    for what, value in off.items():
        t[[u.name for u in names].index(what)] = value
    sigma = np.nan_to_num(p.experiment.sigma)
    x = (p.experiment.position - p.experiment.position.mean(0)) / np.ptp(p.experiment.position, axis=0)
    wave = np.sin(x @ (6.0 * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    noise = sigma * (rng.standard_normal(sigma.shape) + np.pad(wave, ((0, 0), (0, 3))))
    return machine, p.experiment.with_readings(predicted(p, names, t) + noise)


@pytest.mark.parametrize(
    ("name", "poses", "what"),
    [
        ("linear-delta", 30, "gain of c.carriage"),
        ("linear-delta", 600, "gain of c.carriage"),
        ("ur10", 40, "turn of arm.wrist_1 about x"),
        ("ur10", 600, "turn of arm.wrist_1 about x"),
    ],
)
def test_a_fault_does_not_disappear_with_more_readings(name: str, poses: int, what: str) -> None:
    machine, data = twin(name, poses, {what: 12.0})
    c = calibrate(machine, data)
    (found,) = c.beyond
    assert what in (found.name, *found.rivals)
    machine, quiet = twin(name, poses, {})
    assert not calibrate(machine, quiet).beyond


def test_large_pulls_are_said_and_are_no_tolerance() -> None:
    machine, data = twin("ur10", 150, {}, small=3.0)
    c = calibrate(machine, data)
    assert not c.pulls.within and c.pulls.rms > 2.0
    assert c.verdict != "adjusted within tolerance"
    (line,) = [x for x in c.lines() if x.startswith("large pulls")]
    assert f"--tolerance {c.pulls.factor:g}" in line
    wide = calibrate(machine, data, tolerances=Tolerances().scaled(c.pulls.factor))
    assert wide.pulls.within
    assert not wide.beyond


def test_pulls_of_the_directions_that_readings_tell_are_chi_square() -> None:
    rng = np.random.default_rng(1)
    told, names = np.ones(4, bool), list("abcd")
    p = []
    for _ in range(400):
        columns = rng.standard_normal((60, 4)) * [3.0, 1.0, 0.7, 0.5]
        sums = Sums.of(columns, columns @ rng.standard_normal(4) + rng.standard_normal(60))
        p.append(pulls(sums, names, np.zeros(4), told).p)
    assert np.quantile(p, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.06)
    one = pulls(Sums.of(np.eye(4), np.zeros(4)), names, np.array([0.5, -6.0, 5.0, 9.0]), told & [1, 1, 1, 0])
    assert one.large == (("b", -6.0), ("c", 5.0)) and not one.within

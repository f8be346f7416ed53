"""Waves of a drive: their periods lie between those of the search's grid, and one drive may have several."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.library.commands import frequencies


def diagnosed(
    machine: str, drive: str, leg: str, waves: tuple[tuple[float, float], ...], seed: int
) -> sm.Diagnosis:
    """The diagnosis of 60 poses with waves of these amplitudes and periods, m or rad."""
    m = sm.load_machine(machine)
    p = Predictor(m, random_plan(m, "position", poses=60, loads=1, seed=seed))
    true = [
        AppliedEffect("periodic_error", drive, (leg,), (("amplitude", a), ("period", t), ("phase", 0.4 + t)))
        for a, t in waves
    ]
    noise = np.nan_to_num(p.experiment.sigma) * np.random.default_rng(seed).standard_normal(p().shape)
    return sm.diagnose(m, p.experiment.with_readings(p(true) + noise), cross_validate=False)


@pytest.mark.parametrize(
    ("machine", "drive", "leg", "waves", "seed"),
    [
        # 140 times the noise: what a grid misses of it is as large as any other effect
        ("ur10", "elbow", "arm", ((4e-3, 1.1),), 2),
        ("linear-delta", "carriage", "a", ((2e-5, 0.013), (2e-5, 0.04)), 1),
    ],
)
def test_every_wave_of_a_drive_is_found_and_nothing_else(
    machine: str, drive: str, leg: str, waves: tuple[tuple[float, float], ...], seed: int
) -> None:
    d = diagnosed(machine, drive, leg, waves, seed)
    assert d.verdict == "effects" and not d.unexplained
    assert [(e.kind, e.element, e.legs) for e in d.effects] == [("periodic_error", drive, (leg,))] * len(
        waves
    )
    found = sorted(d.effects, key=lambda e: e.parameters["period"][0])
    for e, (amplitude, period) in zip(found, waves, strict=True):
        for name, true in (("amplitude", amplitude), ("period", period)):
            value, low, high, _ = e.parameters[name]
            assert abs(value - true) < high - low, f"{name} {value} [{low}, {high}]"


@pytest.mark.parametrize("number", [6, 11, 40])
def test_poses_in_equal_steps_show_no_wave_shorter_than_two_steps(number: int) -> None:
    step = 0.07
    equal, rng = step * np.arange(number), np.random.default_rng(number)
    apart = np.sort(rng.uniform(0.0, equal[-1], number))
    found = {name: frequencies(float(np.ptp(u)), u) for name, u in (("equal", equal), ("apart", apart))}
    assert 1.0 / found["equal"].max() == pytest.approx(2.0 * step, rel=0.2)
    assert 1.0 / found["apart"].max() < step
    # a shorter one is a longer one there, and is not elsewhere
    for u, alike in ((equal, True), (apart, False)):
        short, long = (np.exp(2j * np.pi * f * u) for f in (0.8 / step, 0.2 / step))
        assert (np.abs(short @ long) / number > 0.99) == alike

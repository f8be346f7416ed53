"""Zeros set anew in each set-up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.virtual.plans import with_distances
from stiffmap.identification.calibration import calibrate
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted, sensitivity, zeros_anew


def sessions(size: float, labels: str = "abc") -> tuple[sm.Machine, Experiment]:
    """Set-ups of an Orthoglide, each with zeros of its own, `size` standard uncertainties."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=36, seed=4)
    names = tuple(labels[int(g) % len(labels)] for g in plan.groups)
    plan = replace(plan, setup=names)
    predictor = Predictor(machine, plan)
    zeros = [u for u in unknowns(machine.description, plan) if u.group == "zeros"]
    rng = np.random.default_rng(1)
    reading = np.zeros_like(plan.reading)
    for name in labels:
        here = np.array(names) == name
        reading[here] = predicted(predictor, zeros, size * rng.standard_normal(len(zeros)))[here]
    noise = np.nan_to_num(plan.sigma) * rng.standard_normal(reading.shape)
    return machine, plan.with_readings(reading + noise)


@pytest.mark.parametrize(("labels", "by"), [("abc", "poses"), ("abcd", "set-ups")])
def test_zeros_of_each_set_up_are_found_where_they_differ(labels: str, by: str) -> None:
    """Few set-ups are not left out whole: what the others have is then another amount of readings."""
    machine, data = sessions(1.0, labels)
    c = calibrate(machine, data)
    own = [r for r in c.rows if "in set-up" in r.name]
    assert len(own) == 3 * len(labels)
    assert c.after.rms < 1.2 * c.noise
    assert c.held_out is not None and c.held_out.by == by
    assert c.held_out.after.rms < 1.3 * c.noise < 0.3 * c.held_out.before.rms
    assert c.verdict == "adjusted within tolerance"


def test_a_machine_that_is_not_homed_anew_has_one_set_of_zeros() -> None:
    machine, data = sessions(0.0)
    c = calibrate(machine, data)
    assert c.verdict == "as declared"
    assert not any(abs(r.value) > 3.0 * r.sigma for r in c.rows if "in set-up" in r.name)


def test_columns_of_a_set_up_are_those_of_the_zero_in_its_rows() -> None:
    machine, data = sessions(0.0)
    predictor = Predictor(machine, data)
    e, found = predictor.experiment, sensitivity(predictor, unknowns(machine.description, data))
    more = zeros_anew(found, e)
    assert len(more.unknowns) > len(found.unknowns)
    for i, u in enumerate(more.unknowns):
        if u.setup:
            up, down = (predicted(predictor, [u], np.array([h])) for h in (0.1, -0.1))
            expected = np.nan_to_num(up - down) / 0.2
            assert np.nan_to_num(more.columns[..., i]) == pytest.approx(expected, rel=1e-5, abs=1e-11)
    assert zeros_anew(found, replace(e, setup=())) is found


def test_a_set_up_without_distances_is_predicted_by_its_own_rows() -> None:
    """Heights in both set-ups, distances in one: rows of a set-up are predicted by themselves."""
    machine = sm.load_machine("linear-delta")
    plan = with_distances(random_plan(machine, "position", poses=8, repeats=1), 1e-5)
    first = np.arange(len(plan)) < len(plan) // 2
    dd = [c.name for c in plan.channels].index("dd")
    assert plan.other is not None
    reading = plan.reading.copy()
    reading[~first, dd] = np.nan
    reading[~first, 0] = 0.0
    other = np.where(first[:, None], plan.other, np.nan)
    whole = Predictor(machine, replace(plan, other=other, reading=reading))
    part = Predictor(machine, replace(plan, other=other, reading=reading))
    assert np.isfinite(whole()[first, dd]).all()
    part.experiment = part.experiment.rows(~first)
    part._memory.clear()
    assert np.isnan(part()[:, dd]).all()

"""Creep, warming and drift: said in every report with times, and no cause of their own in the machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.oracle.twins.generator import twin

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan, residual
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.over_time import OverTime, over_time
from stiffmap.experiment.noise.whitening import LinearProblem

CREEP = np.array([0.5, -1.0, 0.7])


def session(course: str, seed: int = 0) -> tuple[sm.Machine, Experiment]:
    """The declared machine under noise, and a course over time of four standard deviations."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=60, repeats=1, seed=3)
    t = np.arange(60) / 60
    wave = {"none": 0 * t, "creep": np.exp(-6 * t), "warming": t**2, "drift": t}[course]
    size = 4.0 * plan.sigma[0, 0]
    reading = Predictor(machine, plan)() + np.nan_to_num(plan.sigma) * np.random.default_rng(
        seed
    ).standard_normal(plan.sigma.shape)
    reading[:, :3] += size * wave[:, None] * CREEP
    return machine, replace(plan.with_readings(reading), order=np.arange(60.0))


def course_of(machine: sm.Machine, e: Experiment) -> OverTime | None:
    base = Predictor(machine, e)()
    problem = LinearProblem.of(e, noise_of(e).sigma, base)
    return over_time(problem, problem.residual(base))


@pytest.mark.parametrize("course", ["creep", "warming", "drift"])
def test_a_course_over_time_is_seen_and_said(course: str) -> None:
    machine, e = session(course)
    found = course_of(machine, e)
    assert found is not None and found.moves
    told = residual(machine, e).limitations
    assert any("what is left goes with time (order" in line for line in told)
    shuffled = replace(e, order=np.random.default_rng(1).permutation(60).astype(float))
    again = course_of(machine, shuffled)
    assert again is not None and not again.moves
    assert course_of(machine, replace(e, order=None)) is None
    assert not any("time" in line for line in residual(machine, replace(e, order=None)).limitations)


def test_noise_has_no_course() -> None:
    """p-values are uniform: none of forty below 1e-4, their mean near a half."""
    p = [c.p for c in (course_of(*session("none", seed)) for seed in range(40)) if c is not None]
    assert len(p) == 40 and min(p) > 1e-4
    assert np.mean(p) == pytest.approx(0.5, abs=0.2)


def test_creep_is_no_play() -> None:
    """A machine without a fault whose set-up settles: neither its drives nor its joints are named for that."""
    t = twin(1041, kind="creep", faults=0, poses=30, strength=0.0, spread=0.3)
    d = sm.diagnose(t.machine, t.experiment)
    assert not [e for e in d.effects if e.kind != "drift"]
    assert any("goes with time" in line for line in d.limitations)


def test_a_true_fault_stands_beside_creep() -> None:
    machine, e = session("creep")
    real = machine.with_effect("lead_error", element="actuator", legs=["x"], slope=3e-3)
    shift = Predictor(real, e)() - Predictor(machine, e)()
    d = sm.diagnose(machine, e.with_readings(e.reading + shift), cross_validate=False)
    named = [(x.kind, x.element, x.legs) for x in d.effects]
    assert ("lead_error", "actuator", ("x",)) in named or (
        d.calibration is not None and any("x.actuator" in b.name for b in d.calibration.beyond)
    ), (d.verdict, named, d.refused)


def jumped(after: int = 24) -> tuple[sm.Machine, Experiment]:
    """Sixty poses; the instrument was moved by four standard deviations after some of them."""
    machine, e = session("none")
    shift = np.where(np.arange(60)[:, None] >= after, 4.0 * e.sigma[0, 0] * CREEP, 0.0)
    return machine, e.with_readings(e.reading + np.hstack([shift, np.zeros((60, e.reading.shape[1] - 3))]))


def test_an_instrument_that_was_moved_is_named_with_the_reading_since_when() -> None:
    machine, e = jumped()
    d = sm.diagnose(machine, e)
    assert [x.kind for x in d.effects] == ["frame_jump"]
    found = d.effects[0].parameters
    assert found["since"][0] == pytest.approx(24.0, abs=1.0)
    for axis, true in zip("xyz", 4.0 * e.sigma[0, 0] * CREEP, strict=True):
        _, low, high, _ = found[axis]
        assert low < true < high
    assert d.held_out is not None and d.held_out.after.rms < 0.7 * d.held_out.before.rms


@pytest.mark.parametrize("in_order", [True, False])
def test_rows_that_go_on_from_each_other_ask_for_their_order(in_order: bool) -> None:
    machine, e = jumped()
    rows = np.arange(60) if in_order else np.random.default_rng(1).permutation(60)
    d = sm.diagnose(machine, replace(e, order=None).rows(rows), cross_validate=False)
    assert any("add a column `order`" in line for line in d.limitations) == in_order

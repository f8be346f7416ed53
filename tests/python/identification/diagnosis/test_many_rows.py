"""Sums over many rows without columns that are written out: against the columns themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan, simulate
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import Problem, readings_of
from stiffmap.identification.candidates import sensitivity
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.fourier import Fourier
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.candidates.stack import Dense, Stack
from stiffmap.identification.candidates.waves import Wave, Waves
from stiffmap.identification.diagnosis.slips.screen import Screen

N = 40


@pytest.mark.parametrize("count", [1, 2, 301])
def test_sums_are_those_of_the_waves_themselves(count: int) -> None:
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-2.0, 3.0, N), rng.standard_normal((N, 3))
    f = 0.7 + 0.3 * np.arange(count)
    direct = np.exp(2j * np.pi * np.outer(f, u)) @ v
    assert Fourier(u, 0.7, 0.3, count)(v) == pytest.approx(direct, abs=1e-11 * np.abs(v).sum())


def positions(zeros: bool = False) -> Experiment:
    machine = sm.load_machine("orthoglide-revised")
    quantity = "deflection" if zeros else "position"
    plan = random_plan(machine, quantity, poses=N // 4, loads=2, repeats=2, seed=1)
    if not zeros:
        plan = replace(plan, frame="unknown")
    data = simulate(machine, plan, seed=2)
    return replace(data, zero_sigma=np.array([1e-6, 2e-6, 0.0, 0.0, 0.0, 0.0])) if zeros else data


def problem_of(data: Experiment) -> Problem:
    base = np.zeros_like(data.reading)
    return Problem.of(data, noise_of(data).sigma, base, np.arange(len(data)) % 5 > 0)


def waves_of(data: Experiment) -> Waves:
    """Two drives with an error of one period, at 30 frequencies."""
    rng = np.random.default_rng(3)
    rows, axes = readings_of(data, np.zeros_like(data.reading))
    travels = [data.position[:, 0], 0.4 * data.position[:, 1] + 0.3]
    slopes = [1e-5 * rng.standard_normal(len(axes)) for _ in travels]
    return Waves.of(rows, travels, slopes, 1.0 + 0.4 * np.arange(30))


@pytest.mark.parametrize("zeros", [False, True])
def test_periods_that_are_not_stored_screen_as_those_that_are(zeros: bool) -> None:
    data = positions(zeros)
    problem, waves = problem_of(data), waves_of(data)
    stored = Dense(np.stack([waves.line(k) for k in range(30)]))
    y = np.random.default_rng(5).standard_normal((len(waves.rows), 70))
    size = np.abs(stored.along(y)).max()
    assert waves.along(y) == pytest.approx(stored.along(y), abs=1e-11 * size)
    gram = stored.gram(problem)
    assert waves.gram(problem) == pytest.approx(gram, abs=1e-10 * np.abs(gram).max())
    assert waves.only(np.array([3, 7])).along(y) == pytest.approx(stored.along(y)[[3, 7]], abs=1e-11 * size)


def test_a_screen_of_either_says_the_same() -> None:
    data = positions()
    problem, waves = problem_of(data), waves_of(data)
    candidate = Candidate("periodic_error", "actuator", ("x",), ())
    one = [Variant(candidate, Wave(waves, k), np.zeros(2), (("period", k + 1.0),)) for k in range(30)]
    both = [Stack.of(one), Stack.of([replace(v, lines=v.array()) for v in one])]
    assert isinstance(both[0].parts[0], Waves) and isinstance(both[1].parts[0], Dense)
    rng = np.random.default_rng(6)
    residual = rng.standard_normal((len(problem), 4))
    tangent = np.linalg.qr(rng.standard_normal((len(problem), 2)))[0]
    screens = [Screen.of(problem, s.only(np.array([2, 5, 11]))).beside(tangent) for s in both]
    first, second = screens
    assert first.rank.tolist() == second.rank.tolist() == [2, 2, 2]
    assert first.delta_chi2(residual) == pytest.approx(second.delta_chi2(residual), rel=1e-8)
    assert first.columns(1) == pytest.approx(second.columns(1), abs=1e-9)


@pytest.mark.parametrize("zeros", [False, True])
def test_the_adjoint_is_the_transpose_of_whitening(zeros: bool) -> None:
    problem = problem_of(positions(zeros))
    rng = np.random.default_rng(7)
    lines, x = rng.standard_normal((4, len(problem.used))), rng.standard_normal((len(problem), 3))
    direct = problem.white_lines(lines).T @ x
    assert lines @ problem.adjoint(x) == pytest.approx(direct, rel=1e-9)


def test_a_diagnosis_is_the_same_whether_periods_are_stored_or_not(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=24, seed=1)
    wavy = machine.with_effect(
        "periodic_error", element="actuator", legs=["y"], amplitude=3e-5, period=0.05, phase=0.4
    )
    data = simulate(machine, plan, wavy.description.effects, seed=2)
    stored = sm.diagnose(machine, data, cross_validate=False)
    monkeypatch.setattr(sensitivity, "MOST_STORED", 0)
    other = sm.diagnose(
        machine, replace(data, name="again", order=np.arange(float(len(data)))), cross_validate=False
    )
    assert [str(e) for e in other.effects] == [str(e) for e in stored.effects]
    assert stored.verdict == other.verdict == "effects"

"""Ends of profile intervals, against rises that can be worked out by hand; failed poses in a problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan, simulate
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.diagnosis.fitting.interval import NEAR, RISE, profile_end


@pytest.mark.parametrize("curvature", [1.0, 0.01, 40.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_parabola(curvature: float, sign: float) -> None:
    """rise = (x - 2)² c: the end is 2 ± sqrt(3.84 / c), however wrong the first step."""
    end, found = profile_end(lambda x: curvature * (x - 2) ** 2, 2.0, sign * 0.7, sign * 1e6, RISE)
    assert found
    assert end == pytest.approx(2 + sign * np.sqrt(RISE / curvature), abs=2 * NEAR * 0.7)


def test_a_skew_rise() -> None:
    end, found = profile_end(lambda x: np.expm1(x) ** 2, 0.0, 0.3, 100.0, RISE)
    assert found and end == pytest.approx(np.log1p(np.sqrt(RISE)), abs=0.005)


def test_a_bound_ends_it() -> None:
    assert profile_end(lambda x: x**2, 0.0, 1.0, 1.5, RISE) == (1.5, True)
    assert profile_end(lambda x: x**2, 1.5, 1.0, 1.5, RISE) == (1.5, True)


def test_where_the_machine_fails_nothing_is_found() -> None:
    """Beyond 1 nothing can be solved, and the rise is only 1 there: the end is told, but flagged."""
    end, found = profile_end(lambda x: x**2 if x < 1 else np.inf, 0.0, 1.7, 100.0, RISE)
    assert not found and end == pytest.approx(1.0, abs=0.02)


def test_a_flat_rise_is_flagged() -> None:
    assert profile_end(lambda x: 1e-9 * abs(x), 0.0, 1.0, 1e9, RISE)[1] is False


def test_a_failed_pose_is_no_residual_of_a_metre() -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = simulate(machine, random_plan(machine, "position", poses=5, repeats=1, seed=2))
    base = Predictor(machine, plan)(())
    problem = Problem.of(plan, plan.sigma, base)
    broken = base.copy()
    broken[3] = np.nan
    assert np.isfinite(problem.residual(base)).all()
    with pytest.raises(
        sm.StiffmapError, match="1 rows of the experiment have no equilibrium, the first is '4'"
    ):
        problem.residual(broken)
    without = Problem.of(replace(plan), plan.sigma, broken)
    assert np.isfinite(without.residual(broken)).all()

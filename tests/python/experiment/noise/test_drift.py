"""Drift goes with the order of the readings, or with the hours between them, as its option says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment, random_plan, save_experiment
from stiffmap.model.description import AppliedEffect

HOURS = np.array([8.0, 8.5, 12.0, 20.0, 8.25, 9.0])


@pytest.fixture(scope="module")
def plan(orthoglide: sm.Machine) -> Experiment:
    plan = random_plan(orthoglide, "position", poses=6, repeats=1, seed=3)
    return replace(plan, order=np.arange(6.0), hours=HOURS)


def drift(per: str) -> AppliedEffect:
    return AppliedEffect("drift", "sensor", (), (("x", 2e-6), ("z", -1e-6)), (("per", per),))


@pytest.mark.parametrize(("per", "clock"), [("order", np.arange(6.0)), ("hour", HOURS - 8.0)])
def test_drift_follows_its_clock(
    orthoglide: sm.Machine, plan: Experiment, per: str, clock: np.ndarray
) -> None:
    predictor = Predictor(orthoglide, plan)
    moved = predictor((drift(per),)) - predictor(())
    np.testing.assert_allclose(moved[:, 0], 2e-6 * clock, atol=1e-15)
    np.testing.assert_allclose(moved[:, 2], -1e-6 * clock, atol=1e-15)


def test_a_clock_that_is_missing_is_said(orthoglide: sm.Machine, plan: Experiment) -> None:
    with pytest.raises(sm.StiffmapError, match="drift per hour needs a column 'hours'"):
        Predictor(orthoglide, replace(plan, hours=None))((drift("hour"),))


def jump(since: float) -> AppliedEffect:
    return AppliedEffect("frame_jump", "sensor", (), (("x", 2e-6), ("z", -1e-6), ("since", since)))


@pytest.mark.parametrize(
    ("since", "has"),
    [(3.0, [0, 0, 0, 1, 1, 1]), (3.25, [0, 0, 0, 0.75, 1, 1]), (9.0, [0] * 6), (-2.0, [1] * 6)],
)
def test_a_jump_is_in_the_reading_since_when_and_all_later_ones(
    orthoglide: sm.Machine, plan: Experiment, since: float, has: list[float]
) -> None:
    """Whatever other readings there are."""
    for rows in (np.arange(6), np.array([0, 1, 2, 4]), np.array([5, 3, 0])):
        predictor = Predictor(orthoglide, plan.rows(rows))
        moved = predictor((jump(since),)) - predictor(())
        np.testing.assert_allclose(moved[:, :3], np.outer(has, [2e-6, 0.0, -1e-6])[rows], atol=1e-15)


def test_a_jump_without_an_order_is_refused(orthoglide: sm.Machine, plan: Experiment) -> None:
    with pytest.raises(sm.StiffmapError, match="a jump since a reading needs a column 'order'"):
        Predictor(orthoglide, replace(plan, order=None))((jump(3.0),))


def test_hours_are_kept_in_files(plan: Experiment, tmp_path: Path) -> None:
    noisy = replace(plan, reading=np.where(plan.read, 1e-5, np.nan))
    save_experiment(noisy, tmp_path / "twin")
    back = load_experiment(tmp_path / "twin")
    assert back.hours is not None
    np.testing.assert_array_equal(back.hours, HOURS)

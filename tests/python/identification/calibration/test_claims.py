"""What is claimed beyond tolerance, and what is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan, simulate
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.field import covariance, shapes
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration import Unknown, calibrate, unknowns
from stiffmap.identification.calibration.claims import (
    LENGTHS,
    MOST_COLUMNS,
    MOST_SHAPES,
    SIZES,
    BesideField,
    claims,
    field_columns,
)
from stiffmap.identification.calibration.floor import Blocks, model_form
from stiffmap.identification.calibration.model import predicted
from stiffmap.identification.calibration.statistics import Sums, gain_of


def plan_of(name: str, quantity: str = "position", poses: int = 40) -> tuple[sm.Machine, Experiment]:
    machine = sm.load_machine(name)
    plan = random_plan(machine, quantity, poses=poses, loads=6, repeats=2, seed=1)
    return machine, replace(plan, frame="unknown") if quantity == "position" else plan


def odd_positions(name: str, seed: int) -> tuple[sm.Machine, Experiment]:
    """A machine as declared, and long waves over the workspace that none of its numbers makes."""
    machine, plan = plan_of(name)
    twin = simulate(machine, plan, [], seed=seed)
    rng = np.random.default_rng(seed)
    x = (twin.position - twin.position.mean(0)) / np.ptp(twin.position, axis=0)
    waves = 1e-4 * np.sin(x @ (4.0 * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    return machine, twin.with_readings(twin.reading + np.pad(waves, ((0, 0), (0, 3))))


def odd_deflections(name: str) -> tuple[sm.Machine, Experiment]:
    """A machine as declared, and a tool that yields otherwise at each place."""
    machine, plan = plan_of(name, "deflection", 10)
    twin = simulate(machine, plan, [], seed=3)
    c = np.random.default_rng(5).standard_normal((6, 6))
    x = (twin.position - twin.position.mean(0)) / np.ptp(twin.position, axis=0)
    more = (twin.wrench / np.abs(twin.wrench).max()) @ (c @ c.T) * (1.0 + x[:, [0]] * x[:, [1]])
    more *= 0.5 * np.nanmedian(np.abs(twin.reading[:, :3])) / np.abs(more).max()
    return machine, twin.with_readings(twin.reading + more)


@pytest.mark.parametrize(
    ("name", "seed"), [("linear-delta", 2), ("rotary-delta", 2), ("orthoglide-revised", 6), ("ur10", 1)]
)
def test_what_nothing_explains_is_unattributed(name: str, seed: int) -> None:
    machine, data = odd_positions(name, seed)
    c = calibrate(machine, data)
    assert c.verdict == "unattributed"
    assert not c.beyond and not c.wider
    assert c.floor > 3.0 * c.noise


@pytest.mark.parametrize("name", ["rotary-delta", "orthoglide-revised"])
def test_many_wrong_numbers_are_no_answer(name: str) -> None:
    """Groups of numbers ten times beyond tolerance imitate a tool that yields: not better than any smooth field, or far beyond what
    a tolerance may be."""
    machine, data = odd_deflections(name)
    c = calibrate(machine, data)
    assert c.verdict == "unattributed"
    assert not c.beyond and not c.wider
    assert "smooth field" in c.refused[0] or "standard uncertainties are no tolerance" in c.refused[0]
    assert "  refused: " + c.refused[0] in c.lines()
    assert c.as_plain()["refused"] == list(c.refused)


@pytest.mark.parametrize(
    ("name", "what"), [("linear-delta", "shift of b.end along x"), ("ur10", "gain of arm.elbow")]
)
def test_a_fault_is_named_beside_a_rest(name: str, what: str) -> None:
    machine, plan = plan_of(name)
    predictor = Predictor(machine, plan)
    names = unknowns(machine.description, predictor.experiment)
    rng = np.random.default_rng(3)
    t = 0.5 * rng.standard_normal(len(names))
    t[[u.name for u in names].index(what)] = 40.0
    x = (plan.position - plan.position.mean(0)) / np.ptp(plan.position, axis=0)
    rest = 3e-5 * np.sin(x @ (4.0 * rng.standard_normal((3, 3))))
    noise = np.nan_to_num(plan.sigma) * rng.standard_normal(plan.reading.shape)
    data = plan.with_readings(predicted(predictor, names, t) + np.pad(rest, ((0, 0), (0, 3))) + noise)
    c = calibrate(machine, data)
    (found,) = c.beyond
    assert what in (found.name, *found.rivals)


def test_what_is_let_go_goes_through_the_full_prediction() -> None:
    """30 mrad of an elbow are no straight line any more: the machine as built leaves what the answer says it leaves."""
    machine, plan = plan_of("ur10")
    far = machine.with_effect("zero_offset", element="elbow", error=0.03)
    data = simulate(far, replace(plan, frame="known"), [], seed=2)
    c = calibrate(machine, replace(data, joints=None))
    assert c.beyond
    assert c.rms_after < 1.2 * c.noise
    again = Predictor(c.machine, c.experiment)()
    assert c.residual == pytest.approx(c.experiment.reading - again, abs=1e-7, nan_ok=True)


def test_a_number_farther_off_than_any_tolerance_is_not_claimed() -> None:
    rng = np.random.default_rng(3)
    column = 5.0 * rng.standard_normal((400, 1))
    zero = Unknown("zero of drive", "zeros", "m", 2e-4)
    for size, claimed in ((60.0, True), (150.0, False)):
        sums = Sums.of(column, size * column[:, 0] + rng.standard_normal(400))
        found = claims(sums, [zero], {"zeros": [0]}, (), None, lambda before, after, which: "")
        assert found.any is claimed
        assert bool(found.refused) is not claimed
    assert "150 standard uncertainties" in found.refused[0]


def test_groups_that_do_not_suffice_are_withdrawn() -> None:
    rng = np.random.default_rng(0)
    columns = 5.0 * rng.standard_normal((300, 6))
    sums = Sums.of(columns, columns @ (8.0 * np.ones(6)) + rng.standard_normal(300))
    members = {"first": [0, 1, 2], "second": [3, 4, 5]}
    names = [Unknown(f"n{i}", "first" if i < 3 else "second", "m", 1e-4) for i in range(6)]
    asked: list[float] = []

    def first_only(before: Floats, after: Floats, which: Sequence[int]) -> str:
        asked.append(float(before.max()))
        return "" if before.max() == 1.0 else "no"

    found = claims(sums, names, members, (), None, first_only)
    assert asked == [1.0, 10.0]
    assert not found.any and (found.factor == 1.0).all()
    assert "and no" in found.refused[0]


def test_evidence_beside_the_field_is_the_marginal_density() -> None:
    machine, plan = plan_of("linear-delta", poses=8)
    data = simulate(machine, plan, [], seed=4)
    problem = Problem.of(data, data.sigma, Predictor(machine, data)())
    rng = np.random.default_rng(1)
    left = 1e-4 * rng.standard_normal(data.reading.shape)
    columns, linear = rng.standard_normal((len(problem), 3)), 4.0 * rng.standard_normal(len(problem))
    label = (problem.groups * 6 + problem.index[1]).astype(np.intp)
    field = [problem.white(field_columns(data, left, length)) for length in LENGTHS]
    beside = BesideField.of(problem, columns, linear, label, left)
    factor = np.array([1.0, 3.0, 1.0])
    same = (label[:, None] == label[None, :]).astype(float)
    wide = columns * factor

    def density(size: float, rho: float, k: int) -> float:
        v = np.eye(len(linear)) + rho * same + wide @ wide.T + size**2 * field[k] @ field[k].T
        return float(multivariate_normal(np.zeros(len(linear)), v).logpdf(linear))

    rhos = np.expm1(np.linspace(0.0, 5.0, 60))
    known = max(density(s, r, k) for s in (0.0, *SIZES) for r in rhos for k in range(len(LENGTHS)))
    best = known + 0.5 * len(linear) * np.log(2.0 * np.pi)
    assert beside.log_evidence(factor) == pytest.approx(best, abs=0.02)
    blocks = Blocks.of(wide, linear, label)
    assert beside.at(factor, 0.0) == pytest.approx(blocks.log_likelihood(model_form(blocks)), abs=0.02)


@pytest.mark.parametrize("quantity", ["position", "deflection"])
def test_few_shapes_stand_for_the_field(quantity: str) -> None:
    _, plan = plan_of("linear-delta", quantity, 10)
    few, all_ = shapes(plan, 40, 1.0), covariance(plan, 1.0)
    assert np.abs(few @ few.T - all_).max() < 0.05
    assert few.shape[1] <= 40


def test_gain_is_judged_fold_by_fold() -> None:
    tests = [np.arange(6) // 2 == k for k in range(3)]
    before, after = np.array([2.0, 2, 3, 3, 4, 4]), np.array([1.0, 1, 1, 1, 1, 1])
    gain, error = gain_of(before, after, tests)
    assert gain == pytest.approx((3 + 8 + 15) / 3)
    assert error == pytest.approx(np.std([3, 8, 15], ddof=1) / np.sqrt(3))


def test_as_many_shapes_as_are_taken_leave_little_of_the_field() -> None:
    """Of three axes over 150 poses; forty shapes left ten times as much, and what was left out passed for an effect."""
    _, plan = plan_of("linear-delta", poses=150)
    few = shapes(plan, min(MOST_SHAPES, MOST_COLUMNS // 3), LENGTHS[0])
    assert np.mean(1.0 - np.sum(few**2, axis=1)) < 1e-3

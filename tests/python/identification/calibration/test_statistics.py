"""Linear-Gaussian inference against densities written out in full."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from stiffmap.identification.calibration.beyond import _gains, as_factor, beyond_tolerance
from stiffmap.identification.calibration.floor import Blocks, model_form
from stiffmap.identification.calibration.groups import compare
from stiffmap.identification.calibration.limits import FREE
from stiffmap.identification.calibration.statistics import Sums, directions, independent
from stiffmap.identification.calibration.unknowns import Unknown

Floats = NDArray[np.float64]


@pytest.fixture
def case() -> tuple[Floats, Floats]:
    rng = np.random.default_rng(4)
    a = rng.standard_normal((30, 5)) * [3.0, 1.0, 0.3, 2.0, 0.0]
    return a, a @ rng.standard_normal(5) + rng.standard_normal(30)


def density(r: Floats, covariance: Floats) -> float:
    return float(
        multivariate_normal(np.zeros(len(r)), covariance).logpdf(r) + 0.5 * len(r) * np.log(2 * np.pi)
    )


def test_evidence_is_the_marginal_density(case: tuple[Floats, Floats]) -> None:
    a, r = case
    assert Sums.of(a, r).log_evidence == pytest.approx(density(r, np.eye(30) + a @ a.T), rel=1e-10)


def test_the_posterior_is_the_conditional_normal(case: tuple[Floats, Floats]) -> None:
    a, r = case
    s = Sums.of(a, r)
    gain = a.T @ np.linalg.inv(np.eye(30) + a @ a.T)
    assert s.estimate == pytest.approx(gain @ r, rel=1e-9)
    assert s.covariance == pytest.approx(np.eye(5) - gain @ a, abs=1e-9)


def test_sums_of_parts_are_those_of_the_whole(case: tuple[Floats, Floats]) -> None:
    a, r = case
    whole, part = Sums.of(a, r), Sums.of(a[:12], r[:12])
    rest = whole - part
    assert rest.estimate == pytest.approx(Sums.of(a[12:], r[12:]).estimate, rel=1e-9)
    values = np.arange(5.0)
    assert rest.misfit(values) == pytest.approx(float(((r - a @ values)[12:] ** 2).sum()), rel=1e-9)


def test_letting_one_go_is_the_evidence_of_a_wider_prior(case: tuple[Floats, Floats]) -> None:
    a, r = case
    gains = _gains(Sums.of(a, r))
    for i in range(5):
        wide = a * np.where(np.arange(5) == i, FREE, 1.0)
        expected = density(r, np.eye(30) + wide @ wide.T) - density(r, np.eye(30) + a @ a.T)
        assert gains[i] == pytest.approx(expected, abs=1e-7)


def test_blocks_share_a_random_effect(case: tuple[Floats, Floats]) -> None:
    a, r = case
    label = np.arange(30) // 3
    shared = np.kron(np.eye(10), np.ones((3, 3)))
    blocks = Blocks.of(a, r, label)
    for rho in (0.0, 0.7, 40.0):
        covariance = np.eye(30) + rho * shared + a @ a.T
        assert blocks.log_likelihood(rho) == pytest.approx(density(r, covariance), rel=1e-9)


def test_the_floor_is_found_and_is_none_where_there_is_none() -> None:
    rng = np.random.default_rng(7)
    label = np.arange(2000) // 2
    a = rng.standard_normal((2000, 4))
    noise = rng.standard_normal(2000)
    model = 3.0 * rng.standard_normal(1000)[label]
    assert model_form(Blocks.of(a, noise, label)) < 0.1
    found = model_form(Blocks.of(a, a @ np.ones(4) + noise + model, label))
    assert found == pytest.approx(9.0, rel=4 * np.sqrt(2 / 1000))


def test_a_minimal_set_spans_what_is_told() -> None:
    """Three columns of rank two: any two stand for all; one that is not felt is in no set."""
    x, y = np.eye(40)[:2] * 50.0
    a = np.column_stack([x, y, x + y, 0.1 * y])
    kept, rest = independent(a.T @ a)
    assert len(kept) == 2 and 3 in rest
    assert np.linalg.matrix_rank(a[:, kept]) == 2
    assert directions(np.column_stack([x, 0 * x])).shape == (2, 1)


def test_groups_that_explain_the_same_are_rivals() -> None:
    rng = np.random.default_rng(1)
    base, one, other = rng.standard_normal((3, 200))
    a = np.column_stack([base, one, one + 0.01 * other, other]) * 5.0
    r = a @ [1.0, 1.0, 0.0, 0.0] + rng.standard_normal(200)
    members = {"base": [0], "lean": [1], "rods": [2], "width": [3]}
    choice = compare(Sums.of(a, r), members, ["base"])
    assert len(choice.chosen) == 1 and choice.chosen[0] in ("lean", "rods")
    (rival,) = choice.rivals
    assert {choice.chosen[0], *rival} == {"lean", "rods"}


def test_nothing_is_chosen_in_noise() -> None:
    rng = np.random.default_rng(2)
    a = rng.standard_normal((300, 12)) * 10.0
    choice = compare(Sums.of(a, rng.standard_normal(300)), {"one": [*range(6)], "two": [*range(6, 12)]})
    assert choice.chosen == ()


def test_a_factor_beyond_tolerance_stays_a_factor() -> None:
    """Readings are linear in a mass: three times it is ln 3 off, less than nothing of it is no explanation."""
    rng = np.random.default_rng(3)
    mass = Unknown("mass of link", "masses", "ln", 0.05)
    own = rng.standard_normal((400, 1))
    weight = 40.0 * own[:, 0]
    for times in (3.0, -2.0):
        reading = weight * (times - 1.0) + rng.standard_normal(400)
        sums = Sums.of(weight[:, None] * mass.u, reading)
        found = beyond_tolerance(sums, [mass])
        if times > 0:
            (one,) = found.found
            assert abs(one.value - np.log(times)) < 3 * one.sigma
            assert one.sigma < 0.01
            value = found.built(sums.scaled(found.factor).estimate * found.factor, [mass])
            assert abs(value[0] * mass.u - np.log(times)) < 0.01
        else:
            assert not found.found


def test_a_factor_is_told_from_where_its_slope_was_taken() -> None:
    """At twice the compliance the slope of the logarithm is twice as large: 0.1 more of it is not 10 % of the declared."""
    c = Unknown("compliance of drive", "drive compliance", "ln", 0.2)
    at = np.log(2.0) / c.u
    assert abs(as_factor(c, at, at) - 2.0) < 1e-12
    assert abs(as_factor(c, at + 0.5, at) - 2.2) < 1e-12
    assert abs(as_factor(c, 5.0) - 2.0) < 1e-12

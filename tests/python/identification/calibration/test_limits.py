"""Sizes that no number has, one rule at a time, and what the search does with them."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.identification.calibration import Unknown
from stiffmap.identification.calibration.beyond import beyond_tolerance
from stiffmap.identification.calibration.claimed_fit import found_again
from stiffmap.identification.calibration.claims import _absurd, claims, held_within
from stiffmap.identification.calibration.limits import refused
from stiffmap.identification.calibration.statistics import Sums

ZERO = Unknown("zero of x", "zeros", "m", 2e-4)
MASS = Unknown("mass of arm", "masses", "ln", 0.05)
DRIVE = Unknown("compliance of x", "drive compliance", "ln", 0.2)
LINK = Unknown("compliance of rod", "link compliance", "ln", 0.2)


@pytest.mark.parametrize(
    ("unknown", "value", "times", "why"),
    [
        (ZERO, 60.0, 1.0, ""),
        (ZERO, -150.0, 1.0, "150 standard uncertainties are no tolerance"),
        (MASS, 20.0, 2.5, ""),
        (MASS, 54.0, 14.6, "no mass is 14.6 times"),
        (MASS, -30.0, 0.2, "no mass is 0.2 times"),
        (DRIVE, 11.0, 9.0, ""),
        (DRIVE, 18.0, 36.0, "no part yields 36 times"),
        (LINK, -6.0, -0.2, "no part yields -0.2 times"),
    ],
)
def test_sizes(unknown: Unknown, value: float, times: float, why: str) -> None:
    told = refused(unknown, value, times)
    assert told.startswith(why) and bool(told) is bool(why)


def test_a_true_fault_is_found_behind_an_absurd_one() -> None:
    """The readings ask most for a number that no machine has so far off; the next one is not lost for it."""
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((400, 2)) * [5.0, 5.0]
    right = columns @ [150.0, 12.0] + rng.standard_normal(400)
    sums = Sums.of(columns, right)
    found = beyond_tolerance(sums, [ZERO, Unknown("zero of y", "zeros", "m", 2e-4)])
    assert [b.name for b in found.found] == ["zero of y"]
    assert "zero of x: 150 standard uncertainties" in found.refused[0]


def test_numbers_are_held_within_their_uncertainties_whatever_the_readings_say() -> None:
    """The prior of one standard uncertainty is overrun by many readings, and narrowed until it holds again."""
    rng = np.random.default_rng(4)
    columns = 20.0 * rng.standard_normal((1000, 3))
    sums = Sums.of(columns, columns @ [12.0, 0.5, -0.3] + rng.standard_normal(1000))
    one = np.ones(3)
    assert sums.estimate[0] == pytest.approx(12.0, abs=0.05)
    held = held_within(sums, one, [0], 2.0)
    assert (sums.scaled(held).estimate * held)[0] == pytest.approx(2.0, rel=1e-2)
    assert (held[1:] == 1.0).all()
    assert held_within(sums, one, [1], 2.0) is one


def test_a_claim_says_in_how_many_other_draws_it_would_be_found() -> None:
    """Against draws: the gain of a column of known weight, by the evidence itself."""
    rng = np.random.default_rng(8)
    nats = 8.0
    gains = 0.5 * (np.sqrt(2.0 * nats) + rng.standard_normal(200_000)) ** 2
    assert found_again(nats) == pytest.approx(float(np.mean(gains > 5.0)), abs=0.03)
    assert found_again(5.0) == pytest.approx(0.5)
    assert found_again(-1.0) == 0.0
    assert found_again(30.0) > 0.999


def test_no_group_is_let_go_with_a_number_that_no_machine_has() -> None:
    """Two compliances that are off: as a whole they explain much, but one of them would be negative."""
    rng = np.random.default_rng(3)
    pair = [Unknown(f"compliance of {n}", "drive compliance", "ln", 0.2) for n in "ab"]
    columns = 2.0 * rng.standard_normal((400, 2))
    free = {"drive compliance": [0, 1]}
    for truth, said in (([-12.0, 9.0], "no part yields"), ([4.0, 4.5], "")):
        sums = Sums.of(columns, columns @ truth + rng.standard_normal(400))
        why = _absurd(sums, pair, np.array([10.0, 10.0]), [0, 1], None)
        assert why.split(": ")[-1].startswith(said) and bool(why) is bool(said)
        found = claims(sums, pair, free, (), None, lambda *_: "")
        assert not (said and found.groups)

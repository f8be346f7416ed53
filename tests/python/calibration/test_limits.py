"""Sizes that no number has, one rule at a time, and what the search does with them."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.calibration import Unknown
from stiffmap.calibration.beyond import beyond_tolerance
from stiffmap.calibration.claims import held_within
from stiffmap.calibration.limits import refused
from stiffmap.calibration.statistics import Sums

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

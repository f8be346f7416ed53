"""Sets A to E: with the effect that they contain the residual is the noise, with another it is not."""

from __future__ import annotations

from functools import cache

import pytest
from tests.python.model.effects.measured import misfit, read, usual

TRUTH = {
    "A-servo": {"kind": "compliance", "element": "actuator", "legs": ["z"], "value": 3.0e-7},
    "B-none": None,
    "C-backlash": {"kind": "dead_zone", "element": "actuator", "legs": ["y"], "half_width": 12e-6},
    "D-gravity": {"kind": "gravity", "scale": 1.0},
    "E-leglength": {"kind": "length", "element": "bar", "legs": ["x"], "error": 0.15e-3},
}
WRONG = [
    ("A-servo", None),
    ("A-servo", {"legs": ["x"]}),
    ("A-servo", {"value": 1.4e-7 / (3.0 / 1.4)}),
    ("B-none", {"kind": "compliance", "element": "actuator", "legs": ["z"], "value": 3.0e-7}),
    ("C-backlash", None),
    ("C-backlash", {"legs": ["x"]}),
    ("D-gravity", None),
    ("D-gravity", {"scale": -1.0}),
    ("E-leglength", None),
    ("E-leglength", {"legs": ["y"]}),
    ("E-leglength", {"error": -0.15e-3}),
]


@cache
def found_with_truth(machine, name):
    return found_with(machine, name, TRUTH[name])


def found_with(machine, name, effect):
    return misfit(machine if effect is None else machine.with_effect(**effect), read(name))


@pytest.mark.parametrize("name", TRUTH)
def test_residual_is_noise(orthoglide, name):
    found = found_with_truth(orthoglide, name)
    assert usual(found.means, found.n_means)


@pytest.mark.parametrize("name", ["A-servo", "B-none", "D-gravity", "E-leglength"])
def test_all_residuals_are_noise(orthoglide, name):
    found = found_with_truth(orthoglide, name)
    assert usual(found.all, found.n_all)


def test_set_c_is_quieter_than_its_declared_noise(orthoglide):
    """Its rms is 0.963 of the declared noise, under the 95 % range, because its repeats scatter as little
    about their own means (0.951, also under), which no model can change: the model part is usual."""
    found = found_with_truth(orthoglide, "C-backlash")
    assert found.all == pytest.approx(0.963**2, abs=1e-3)
    assert found.repeats == pytest.approx(0.951**2, abs=1e-3)
    assert not usual(found.repeats, found.n_all - found.n_means)


@pytest.mark.parametrize(("name", "change"), WRONG)
def test_residual_is_not_noise(orthoglide, name, change):
    effect = None if change is None else {**(TRUTH[name] or {}), **change}
    found = found_with(orthoglide, name, effect)
    assert not usual(found.means, found.n_means)
    assert not usual(found.all, found.n_all)

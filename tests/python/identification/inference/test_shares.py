"""Which tolerances are too narrow without doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.identification.inference.synthetic import columns

from stiffmap.identification.inference.amplitudes import OFF, evaluated, fitted
from stiffmap.identification.inference.parts import Part
from stiffmap.identification.inference.shares import too_wide


@pytest.mark.parametrize("known", [False, True])
def test_numbers_that_show_like_noise_are_too_wide_only_where_repeats_say_how_large_the_noise_is(known):
    rng = np.random.default_rng(3)
    c = columns(rng)
    c = replace(
        c,
        residual=2.5 * rng.normal(size=len(c)),
        zero=np.zeros_like(c.zero),
        repeats=(100.0 * known, 100.0 * known),
    )
    fit = fitted(c, [Part("zeros", "number", np.eye(len(c)))])
    assert fit.spread("zeros") > 1.5
    assert [w.factor for w in too_wide(fit)] == [fit.spread("zeros")] * known


def test_other_numbers_that_are_as_stated_are_no_excuse():
    """Two groups that show the same, one of which took all: the other would have to be as far off."""
    rng = np.random.default_rng(4)
    c = columns(rng)
    d = 3.0 * np.linalg.qr(rng.normal(size=(len(c), 8)))[0]
    c = replace(c, residual=6.0 * d @ rng.normal(size=8) + rng.normal(size=len(c)))
    some = Part("zeros", "number", d), Part("gains", "number", d)
    fit = evaluated(c, some, np.array([0.0, 3.6, OFF]), np.ones(len(c.rows)))
    assert [w.group for w in too_wide(fit)] == ["zeros"]

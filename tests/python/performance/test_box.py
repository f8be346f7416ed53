"""The largest box against the Orthoglide's closed form, and proofs that can fail."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.performance.cells import prove
from stiffmap.performance.limits import Bounds

EDGE = 1 / np.sqrt(18) + 1 / np.sqrt(6)  # of the cube within 0.5…2, times L


@pytest.mark.parametrize(("name", "length"), [("orthoglide-revised", 0.775), ("orthoglide-original", 0.31)])
def test_bounds_hold_the_closed_form(name, length):
    b = sm.largest_box(sm.load_machine(name))
    assert b.edge <= EDGE * length <= b.edge_upper
    assert b.gap <= 1.01e-4
    np.testing.assert_allclose(b.centre, (1 / np.sqrt(6) - 1 / np.sqrt(18)) / 2 * length, atol=2e-2 * length)
    p = np.random.default_rng(0).uniform(*b.corners, (2000, 3))
    v = sm.velocity_transmission(sm.load_machine(name), p)
    assert v.sphere_min.min() >= 0.5 and v.sphere_max.max() <= 2


def test_a_box_that_sticks_out_is_not_proven():
    bounds = Bounds(sm.load_machine("orthoglide-revised"), transmission=(0.5, 2.0))
    low = np.full(3, -0.775 / np.sqrt(18))
    assert prove(bounds, low + 1e-4, low + 0.3).holds
    proof = prove(bounds, low - 1e-4, low + 0.3)
    assert not proof.holds and len(proof.broken)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"proportions": (1, 0, 1)}, "proportions"),
        ({"transmission": (2.0, 0.5)}, "transmission"),
        ({"gap": 0.0}, "gap"),
        ({"region": [[0, 0, 0], [0, 1, 1]]}, "region"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(sm.StiffmapError, match=words):
        sm.largest_box(sm.load_machine("orthoglide-revised"), **options)

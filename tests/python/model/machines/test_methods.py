"""The fast path against the reference path on every shipped machine."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.model.machines import machine_cases as cases

import stiffmap as sm

WRENCH = np.array([30.0, -20, -40, 1.0, 2.0, -1.5])


@pytest.mark.parametrize("name", cases.FLAGS)
def test_fast_is_reference(name: str) -> None:
    machine = sm.load_machine(name)
    p = cases.box(machine)[::2]
    wrench = 0.2 * WRENCH if name.endswith("delta") else WRENCH
    fast, slow = (machine.solve(p, wrench, method=m) for m in ("fast", "reference"))
    np.testing.assert_array_equal(fast.status, slow.status)
    assert slow.ok.all()
    size = np.abs(slow.displacement).max(axis=0)
    np.testing.assert_allclose(fast.displacement / size, slow.displacement / size, rtol=0, atol=1e-8)
    k = np.sqrt(np.einsum("...ii->...i", slow.stiffness))
    k = k[..., :, None] * k[..., None, :]
    np.testing.assert_allclose(fast.stiffness / k, slow.stiffness / k, rtol=0, atol=1e-8)
    force = np.abs(slow.leg_wrench).max()
    np.testing.assert_allclose(fast.leg_wrench / force, slow.leg_wrench / force, rtol=0, atol=1e-8)

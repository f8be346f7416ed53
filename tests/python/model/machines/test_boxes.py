"""Every shipped machine over its whole workspace box: every status and flag is the one expected."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.model.machines import machine_cases as cases

import stiffmap as sm
from stiffmap.model.files import shipped_machines

LIGHT = {"linear-delta": 5.0, "rotary-delta": 20.0, "ur10": 50.0, "five-bar": 50.0, "swing-table": 50.0}


def test_every_shipped_machine_is_a_case() -> None:
    assert {m.name for m in shipped_machines()} == {*cases.FLAGS, "tripteron"}


@pytest.mark.parametrize("name", cases.FLAGS)
def test_box(name: str) -> None:
    machine = sm.load_machine(name)
    force = LIGHT.get(name, 300.0)
    wrench = force * np.array([[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, -1, 0, 0, 0]])[:, None]
    s = machine.solve(cases.box(machine), wrench)
    assert s.count() == {"CONVERGED": s.status.size}
    allowed = cases.FLAGS[name] | sm.Flag.LOAD_STEPPED
    assert set(np.unique(s.flags)) <= {int(cases.FLAGS[name]), int(allowed)}
    assert np.isfinite(s.displacement).all() and np.isfinite(s.actuator_effort).all()
    # a dead pure force leaves the stiffness symmetric, and stable means positive definite
    k = s.stiffness
    scale = np.sqrt(np.einsum("...ii->...i", k))
    k = k / (scale[..., :, None] * scale[..., None, :])
    np.testing.assert_allclose(k, np.swapaxes(k, -1, -2), atol=1e-8)
    assert np.linalg.eigvalsh(0.5 * (k + np.swapaxes(k, -1, -2))).min() > 0
    # legs and external force balance
    np.testing.assert_allclose(
        s.leg_wrench.sum(-2)[..., :3], np.broadcast_to(-wrench[..., :3], s.leg_wrench.sum(-2)[..., :3].shape),
        atol=1e-5 * force,
    )  # fmt: skip


@pytest.mark.parametrize("name", cases.SPINS)
def test_rods_that_spin_are_named(name: str) -> None:
    machine = sm.load_machine(name)
    assert len(machine.free_spins) == cases.SPINS[name]
    s = machine.solve(machine.description.home.p)
    assert set(s.indeterminate) == set(machine.free_spins)


def test_tripteron_box_has_its_known_bad_poses() -> None:
    """Its box touches folded and stretched legs: those poses fail with a status, and with NaN."""
    machine = sm.load_machine("tripteron")
    s = machine.solve(cases.box(machine, 4), [0, 0, 100, 0, 0, 0])
    assert s.ok.sum() > 0
    failed = (s.status == sm.Status.UNREACHABLE) | (s.status == sm.Status.NOT_CONVERGED)
    assert np.isnan(s.displacement[failed]).all()

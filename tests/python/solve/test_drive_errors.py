"""Errors of commanded coordinates and drives whose compliance changes along the stroke (theory G1, G2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import CommandError, Joint, Law, Pose

METHODS = ("fast", "reference")
K = 1e6


def stage(joint: Joint) -> sm.Machine:
    """One drive along x with a guide that lets nothing else move much."""
    return b.serial(joint, b.stiff("guide", 1e12 * np.eye(6)), home=Pose.of((joint.home[0], 0, 0)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("u", [0.1, 0.25, 0.4])
def test_command_errors_add_up(method: str, u: float) -> None:
    errors = (
        CommandError(offset=1e-4, slope=2e-3, reference=0.05),
        CommandError(amplitude=3e-5, period=0.02, phase=0.4, reference=0.01),
    )
    machine = stage(replace(b.slider("drive", home=0.2, law=Law(K)), command_errors=errors))
    wanted = 1e-4 + 2e-3 * (u - 0.05) + 3e-5 * np.sin(2 * np.pi * (u - 0.01) / 0.02 + 0.4)
    s = machine.solve((u, 0, 0), method=method)
    np.testing.assert_allclose(s.displacement, [wanted, 0, 0, 0, 0, 0], rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("u", [0.1, 0.2, 0.45])
def test_compliance_along_the_stroke(method: str, u: float) -> None:
    machine = stage(replace(b.slider("drive", home=0.2, law=Law(K)), compliance_slope=1.5))
    wanted = (1 + 1.5 * (u - 0.2)) / K
    s = machine.solve((u, 0, 0), (250.0, 0, 0, 0, 0, 0), method=method)
    assert s.displacement[0] == pytest.approx(250 * wanted, rel=1e-5)  # the guide gives 1e-12 m/N
    assert s.compliance[0, 0] == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_inverse_kinematics_does_not_know_the_errors(method: str) -> None:
    machine = stage(
        replace(b.slider("drive", home=0.2, law=Law(K)), command_errors=(CommandError(offset=1e-3),))
    )
    assert sm.inverse_kinematics(machine, (0.3, 0, 0)).actuators[0] == pytest.approx(0.3, abs=1e-12)
    assert machine.solve((0.3, 0, 0), method=method).displacement[0] == pytest.approx(1e-3, rel=1e-9)

"""Friction opposes the deflection that the whole load would make, also where the load is applied in steps."""

from __future__ import annotations

import numpy as np

import stiffmap as sm

LEVEL = 2.0  # N·m


def test_signs_of_a_load_in_steps() -> None:
    """A first attempt at the whole load must leave nothing behind: its signs once turned those of the steps."""
    plain = sm.load_machine("ur10")
    machine = plain
    for name in ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"):
        machine = machine.with_effect("friction", element=name, torque=LEVEL, branch="loading")
    rng = np.random.default_rng(5)
    low, high = plain.workspace
    position, wrench = (
        rng.uniform(low, high, (200, 3)),
        rng.normal(size=(200, 6)) * [6e3, 6e3, 6e3, 60, 60, 6],
    )
    answer = machine.solve(position, wrench, method="reference")
    stepped = (answer.flags & sm.Flag.LOAD_STEPPED != 0) & (answer.status == sm.Status.CONVERGED)
    assert stepped.sum() > 20
    start = plain.solve(position).coordinates
    linear = plain.solve(position, 1e-6 * wrench).coordinates - start
    stiffness = np.array([e.law.stiffness for e in plain.description.legs[0].elements if hasattr(e, "law")])
    friction = -answer.actuator_effort - stiffness * (answer.coordinates - start)
    sure = stepped[:, None] & (np.abs(linear) > 1e-10)
    assert sure.sum() > 100
    np.testing.assert_allclose(friction[sure], LEVEL * np.sign(linear[sure]), rtol=1e-6)

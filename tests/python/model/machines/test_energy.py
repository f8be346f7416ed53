"""The answer meets what defines it: legs closed, energy stationary along every motion that keeps them so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.model.machines import energy as oracle, machine_cases as cases

import stiffmap as sm

# machine -> position, rotation vector about x and y, force, gravity
CASES = {
    "hexapod": ([0.1, -0.05, 0.72], (0.1, -0.08), [900, -500, 700]),
    "linear-delta": ([0.06, 0.03, 0.27], (0, 0), [4, -3, -8]),
    "rotary-delta": ([0.1, 0.12, -0.7], (0, 0), [10, -20, -15]),
    "hybrid": ([0.08, -0.05, 0.28], (0.3, -0.2), [500, 400, -300]),
    "ur10": ([-0.8, 0.1, 0.3], (0, 0), [30, 20, -60]),
    "five-bar": ([0.07, 0.41, 0], (0, 0), [50, -40, 30]),
    "swing-table": ([0.12, 0, 0.4], (0, 0), [40, 100, -300]),
    "3-rps": ([0, 0, 0.62], (0.2, -0.15), [200, 100, -400]),
    "travelling-column": ([0.3, 1.25, 0.8], (0, 0), [900, 400, -700]),
    "orthoglide-revised": ([0.1, -0.1, 0.15], (0, 0), [300, 200, -100]),
}


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("name", CASES)
def test_equilibrium(name: str, method: str) -> None:
    machine = sm.load_machine(name)
    p, (a, b), force = CASES[name]
    gravity = np.array([0, 0, -9.81])
    turned = machine.description.home.r @ cases.turn("x", a) @ cases.turn("y", b)
    s = machine.solve(p, [*force, 0, 0, 0], rotation=turned, gravity=gravity, method=method)
    assert s.ok
    drives = sm.inverse_kinematics(machine, p, turned)
    command = dict(zip(machine.actuators, drives.actuators, strict=True))
    energy = oracle.Energy(machine, command, np.array(force, dtype=float), gravity)
    x = dict(zip(s.coordinate_names, s.coordinates, strict=True))

    _, gaps, tcp = energy(x)
    np.testing.assert_allclose(gaps, 0, atol=1e-10)
    np.testing.assert_allclose(tcp - drives.position, s.displacement[:3], rtol=0, atol=1e-10)

    gradient, jacobian = oracle.differences(energy, x, 1e-6)
    if gaps.size:
        _, sizes, v = np.linalg.svd(jacobian)
        motions = v[int((sizes > 1e-8 * sizes[0]).sum()) :]
    else:
        motions = np.eye(len(x))
    left = motions @ gradient
    assert np.abs(left).max() < 1e-6 * max(np.abs(gradient).max(), np.linalg.norm(force))

    # a little off the equilibrium the same measure is far from zero: the test can fail
    off = {**x, machine.actuators[0]: x[machine.actuators[0]] + 1e-5}
    gradient_off, _ = oracle.differences(energy, off, 1e-6)
    assert np.abs(motions @ gradient_off).max() > 100 * np.abs(left).max()


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("name", CASES)
def test_the_commanded_components_are_reached(name: str, method: str) -> None:
    machine = sm.load_machine(name)
    p, (a, b), _ = CASES[name]
    turned = machine.description.home.r @ cases.turn("x", a) @ cases.turn("y", b)
    s = machine.solve(p, rotation=turned, method=method)
    x = dict(zip(s.coordinate_names, s.coordinates, strict=True))
    energy = oracle.Energy(machine, {a: x[a] for a in machine.actuators}, np.zeros(3), np.zeros(3))
    _, gaps, tcp = energy(x)
    np.testing.assert_allclose(gaps, 0, atol=1e-12)
    off = np.r_[tcp - p, Rotation.from_matrix(turned.T @ energy.rotation).as_rotvec()]
    commanded = [name in machine.description.task for name in ("x", "y", "z", "rx", "ry", "rz")]
    np.testing.assert_allclose(off[commanded], 0, atol=1e-12)


@pytest.mark.parametrize(
    "name", ["hexapod", "hybrid", "linear-delta", "five-bar", "3-rps", "travelling-column"]
)
def test_loaded_compliance_is_a_difference_quotient(name: str) -> None:
    machine = sm.load_machine(name)
    p, _, force = CASES[name]
    w = np.array([*force, 0, 0, 0], dtype=float)
    s = machine.solve(p, w, method="reference")
    h = 1e-2 * np.linalg.norm(force)
    errors = []
    for step in (h, h / 2):
        shifts = np.r_[step * np.eye(6), -step * np.eye(6)] * [1, 1, 1, 0.1, 0.1, 0.1]
        d = machine.solve(p, w + shifts, method="reference", load_steps=1).displacement
        quotient = ((d[:6] - d[6:]) / (2 * step * np.array([1, 1, 1, 0.1, 0.1, 0.1]))[:, None]).T
        errors.append(np.abs(quotient[:3] - s.compliance[:3]).max() / np.abs(s.compliance[:3]).max())
    assert errors[1] < 1e-4
    assert errors[1] < errors[0] / 3 or errors[1] < 1e-8

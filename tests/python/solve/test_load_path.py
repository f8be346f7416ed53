"""The answer of `solve` is the continuation of the unloaded equilibrium (theory E9), or it is flagged."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Leg, MachineDescription, Pose
from stiffmap.model.files import description_from_text

LENGTH, ROOT, SHIFT = 0.5, 1000.0, 1e6  # m, N·m/rad, N/m
BUCKLES = ROOT / LENGTH


def column() -> sm.Machine:
    """Turns about y on its elastic root, which also shifts."""
    root = b.stiff("root", np.diag([SHIFT, SHIFT, SHIFT, 1e6, ROOT, 1e6]))
    legs = (Leg("column", (root, b.shift("up", (0, 0, LENGTH)))),)
    return sm.Machine(MachineDescription("column", legs, home=Pose.of((0, 0, LENGTH))))


def leaning(force: float, lean: float) -> float:
    """Angle: the one equilibrium on the side to which a force leans that is off the axis by `lean`."""
    moment = force * LENGTH
    return float(brentq(lambda t: ROOT * t - moment * (np.sin(t) + lean * np.cos(t)), 1e-12, 3.0, xtol=1e-15))


@pytest.mark.parametrize("method", ["reference", "fast"])
@pytest.mark.parametrize("lean", [3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("side", [1, -1])
def test_an_imperfect_column_leans_to_its_side(lean: float, side: int, method: str) -> None:
    machine = column()
    for share in (0.5, 0.9, 0.99, 1 - 1e-9, 1.0, 1 + 1e-9, 1.01, 1.1, 1.3):
        force = share * BUCKLES
        s = machine.solve((0, 0, LENGTH), (side * lean * force, 0, -force, 0, 0, 0), method=method)
        angle = leaning(force, lean)
        assert s.status == sm.Status.CONVERGED, (share, s.status)
        np.testing.assert_allclose(
            s.displacement[0], side * (LENGTH * np.sin(angle) + lean * force / SHIFT), rtol=1e-6
        )


@pytest.mark.parametrize("method", ["reference", "fast"])
@pytest.mark.parametrize("share", [1 - 1e-9, 1.0, 1 + 1e-9])
def test_at_the_critical_load_every_number_is_that_of_an_equilibrium(share: float, method: str) -> None:
    """Exactly upright: indifferent, shorter by F/k, and nothing else."""
    force = share * BUCKLES
    s = column().solve((0, 0, LENGTH), (0, 0, -force, 0, 0, 0), method=method)
    assert s.status in (sm.Status.SINGULAR, sm.Status.UNSTABLE)
    np.testing.assert_allclose(s.displacement, [0, 0, -force / SHIFT, 0, 0, 0], atol=1e-12)


CASES = [
    ("linear-delta", (0.0, 0.0, 0.3), (1, 0, 0), 4000),
    ("linear-delta", (-0.06, 0.04, 0.33), (0.2, -0.5, -0.8), 6000),
    ("linear-delta", (0.07, 0.02, 0.26), (0, 0, 1), 12_000),
    ("rotary-delta", (0.0, 0.0, -0.7), (0, 0, -1), 10_000),
    ("rotary-delta", (0.1, -0.05, -0.75), (0.6, 0.3, 0.7), 10_000),
]


@pytest.mark.parametrize(("name", "at", "direction", "most"), CASES)
def test_solve_follows_the_path_that_sweep_follows(
    name: str, at: tuple[float, ...], direction: tuple[float, ...], most: float
) -> None:
    machine = sm.load_machine(name)
    d = np.array(direction) / np.linalg.norm(direction)
    path = sm.sweep(machine, at, d, limit=most, steps=10)
    force = path.force.values
    wrench = np.hstack([force[:, None] * d, np.zeros((len(force), 3))])
    for method in ("reference", "fast"):
        s = machine.solve(at, wrench, method=method)
        told = (s.flags & sm.Flag.BRANCH_UNVERIFIED) != 0
        np.testing.assert_array_equal(s.status[~told], path.status.values[~told])
        moved = s.displacement[:, :3] @ d
        np.testing.assert_allclose(moved[~told], path.deflection_along.values[~told], rtol=1e-6, atol=1e-12)
        assert not told[0]


SOFT = """
name: soft
units: {{length: m, force: N, angle: rad}}
home: {{translation: [0.6, 0.5, 0], rotation: [[0, -1, 0], [1, 0, 0], [0, 0, 1]]}}
task: [x, y]
legs:
  a:
    elements:
      - {{actuator: j1, kind: revolute, axis: z, law: {{stiffness: {k}, cubic: {cubic}}}}}
      - {{offset: o1, translation: [0.6, 0, 0]}}
      - {{actuator: j2, kind: revolute, axis: z, home: 1.5707963267948966, law: {{stiffness: {k}, cubic: {cubic}}}}}
      - {{offset: o2, translation: [0.5, 0, 0]}}
"""


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("force", [100.0, 1000.0])
@pytest.mark.parametrize(("k", "cubic"), [(10.0, 1e9), (1.0, 1e8), (100.0, 1e12), (1e3, 1e10)])
def test_joints_that_are_soft_at_rest_and_stiffen(k: float, cubic: float, force: float, method: str) -> None:
    """Torques follow from the tip's force alone: tau = k a + c a^3 at each joint, at the moved tip."""
    machine = sm.Machine(description_from_text(SOFT.format(k=k, cubic=cubic)))
    for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        f = force * np.array([np.cos(angle), np.sin(angle)])
        s = machine.solve((0.6, 0.5, 0), [*f, 0, 0, 0, 0], method=method)
        assert s.status == sm.Status.CONVERGED
        a = np.zeros(2)
        for _ in range(200):  # fixed point: the torques hardly depend on the deflection
            q1, q2 = a[0], a[0] + np.pi / 2 + a[1]
            elbow = 0.6 * np.array([np.cos(q1), np.sin(q1)])
            tip = elbow + 0.5 * np.array([np.cos(q2), np.sin(q2)])
            torque = [tip[0] * f[1] - tip[1] * f[0], (tip - elbow)[0] * f[1] - (tip - elbow)[1] * f[0]]
            roots = [np.roots([cubic, 0, k, -t]) for t in torque]
            before, a = a, np.array([np.real(r[np.argmin(np.abs(r.imag))]) for r in roots])
            if np.array_equal(a, before):
                break
        np.testing.assert_allclose(
            s.displacement[:2], tip - [0.6, 0.5], rtol=0, atol=1e-9 * np.linalg.norm(tip - [0.6, 0.5])
        )

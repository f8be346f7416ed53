"""Measures that other files judge on the Orthoglide, here on machines of other kinds: closed forms and brute force."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.performance import fastest, largest_box, line, timed, worst_deflection
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.efforts import acceleration_of
from stiffmap.workspace.performance.motion.trajectory import Trajectory

GANTRY = """
name: gantry
units: {length: m, force: N, angle: rad, mass: kg}
workspace: {x: [-0.1, 0.1], y: [-0.1, 0.1], z: [-0.1, 0.1]}
legs:
  one:
    elements:
      - {actuator: a, kind: prismatic, axis: x, compliance: 1.0e-6, range: [-0.3, 0.2], force: 100, speed: 0.5}
      - {body: bridge, mass: 6}
      - {actuator: b, kind: prismatic, axis: y, compliance: 3.0e-6, range: [-0.1, 0.15], force: 100, speed: 2}
      - {body: carriage, mass: 3}
      - {actuator: c, kind: prismatic, axis: z, compliance: 5.0e-6, range: [-0.2, 0.25], force: 100, speed: 2}
      - {body: tool, mass: 2}
"""


@pytest.fixture
def gantry(tmp_path):
    path = tmp_path / "gantry.yaml"
    path.write_text(GANTRY, encoding="utf-8")
    return sm.load_machine(path)


@pytest.mark.parametrize("proportions", [(1, 1, 1), (2, 1, 1), (1, 0.2, 3)])
def test_the_largest_box_of_a_gantry_is_its_shortest_stroke(gantry, proportions):
    strokes = np.array([0.5, 0.25, 0.45])
    b = largest_box(gantry, proportions, region=[[-0.4] * 3, [0.4] * 3])
    edge = (strokes * proportions[0] / np.array(proportions)).min()
    assert b.proven
    assert b.edge <= edge * (1 + 1e-9) <= b.edge_upper * (1 + 1e-9)
    assert b.gap < 2e-4


def test_worst_deflection_of_springs_in_a_row(gantry):
    """No matter where: the softest drive of the plane."""
    p = np.zeros(3)
    assert worst_deflection(gantry, p, force=10.0).value == pytest.approx(3e-5, rel=1e-9)
    assert worst_deflection(gantry, p, force=10.0, plane="xz").value == pytest.approx(5e-5, rel=1e-9)
    assert worst_deflection(gantry, p, force=10.0, plane=None).value == pytest.approx(5e-5, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "p"), [("linear-delta", [0.03, -0.05, 0.3]), ("hexapod", [0.05, 0.08, 0.7])]
)
def test_worst_deflection_against_all_directions(name, p):
    machine = sm.load_machine(name)
    d = worst_deflection(machine, p, force=200.0)
    angle = np.linspace(0, 2 * np.pi, 361)
    w = np.zeros((361, 6))
    w[:, 0], w[:, 1] = 200 * np.cos(angle), 200 * np.sin(angle)
    every = np.linalg.norm(machine.solve(p, w).displacement[:, :2], axis=1)
    assert every.max() <= d.value * (1 + 1e-9)
    assert d.value == pytest.approx(every.max(), rel=1e-3)


def efforts(machine, p, a):
    """Of the drives at rest, accelerated; from a motion that sets off there."""
    t = np.linspace(0, 1, 9)
    still = np.zeros((9, 3))
    run = Trajectory(t, np.tile(p, (9, 1)), still, np.tile(a, (9, 1)), still)
    return sm.drive_efforts(machine, run, friction=False, gravity=(0, 0, -9.81)).effort.values[0]


@pytest.mark.parametrize(
    ("name", "p"),
    [
        ("orthoglide-revised", [0.2, -0.1, 0.15]),
        ("linear-delta", [0.05, 0.07, 0.3]),
        ("hexapod", [0.05, 0.08, 0.7]),
    ],
)
def test_the_acceleration_in_every_direction_by_inverse_dynamics(name, p):
    """In every direction the efforts stay within their limits at what is reached, and meet one."""
    machine, most = sm.load_machine(name), 3000.0
    least = float(acceleration_of(machine, drive_kinematics(machine, p), efforts=most, gravity=(0, 0, -9.81)))
    rest = efforts(machine, p, np.zeros(3))
    slope = np.stack([efforts(machine, p, e) - rest for e in np.eye(3)], axis=1)  # effort is affine
    rng = np.random.default_rng(5)

    def reached(u):
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        per = u @ slope.T
        return u, ((most * np.sign(per) - rest) / per).min(axis=1)

    u, reach = reached(rng.normal(size=(20000, 3)))
    near = reached(u[np.argmin(reach)] + 0.1 * rng.normal(size=(20000, 3)))
    reach = np.concatenate([reach, near[1]])
    assert reach.min() >= least * (1 - 1e-6)
    assert least == pytest.approx(reach.min(), rel=1e-3)


def test_the_time_of_a_gantry_by_hand(gantry):
    """Along x: all of it is pushed by 100 N up to 0.5 m/s and braked again."""
    s, top, a = 0.4, 0.5, 100 / 11
    t = fastest(gantry, line([-0.25, 0, 0], [0.15, 0, 0], 401))
    assert t.time[-1] == pytest.approx(s / top + top / a, rel=2e-3)
    d = sm.drive_efforts(gantry, t)
    assert float(d.peak_effort.max()) <= 100 * (1 + 1e-6)
    assert float(d.peak_speed.max()) <= top * (1 + 1e-6)


def test_efforts_of_a_gantry_by_hand(gantry):
    """Each drive moves what it carries."""
    t = timed(line([-0.1, -0.05, 0], [0.1, 0.1, 0.2], 41), 0.7)
    d = sm.drive_efforts(gantry, t, gravity=(0, 0, -9.81))
    np.testing.assert_allclose(d.effort, t.acceleration * [11, 5, 2] + [0, 0, 2 * 9.81], atol=1e-9)


def test_ground_and_mass(gantry):
    """All three bodies move; nothing stands beside the strokes."""
    table = sm.measures(gantry, only=["mass", "footprint"], nodes=3, coarse=2)
    assert table["mass"].found.worst == pytest.approx(11)
    assert np.isfinite(table["footprint"].found.worst) or table["footprint"].reason

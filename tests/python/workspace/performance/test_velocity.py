"""Velocity, accuracy and force transmission against closed forms, differences and brute force."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.files.shipped import machine_names
from stiffmap.solve.starters import machine_text
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.efforts import acceleration_of
from stiffmap.workspace.performance.motion.inertia import rigid_dynamics

RNG = np.random.default_rng(15)


def orthoglide_inverse(p, length):
    """Rows [1, y/sx, z/sx] and cyclic."""
    out = np.zeros((*p.shape[:-1], 3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        s = np.sqrt(length**2 - p[..., j] ** 2 - p[..., k] ** 2)
        out[..., i, i], out[..., i, j], out[..., i, k] = 1, p[..., j] / s, p[..., k] / s
    return out


@pytest.mark.parametrize(("name", "length"), [("orthoglide-revised", 0.775), ("orthoglide-original", 0.31)])
def test_orthoglide_jacobian_is_the_closed_form(name, length):
    machine = sm.load_machine(name)
    low, high = machine.workspace
    p = RNG.uniform(low, high, (400, 3))
    j = drive_kinematics(machine, p).jacobian
    np.testing.assert_allclose(
        j[:, :3] @ orthoglide_inverse(p, length), np.broadcast_to(np.eye(3), (400, 3, 3)), atol=1e-9
    )
    np.testing.assert_allclose(j[:, 3:], 0, atol=1e-9)


def test_diagonal_factors_and_the_near_miss_of_the_revised_machine():
    machine = sm.load_machine("orthoglide-revised")
    q = np.array([-0.2, -0.1, 0.0, 0.1, 0.3])
    t = q / np.sqrt(0.775**2 - 2 * q**2)
    v = sm.velocity_transmission(machine, q[:, None] * np.ones(3))
    factors = np.sort(np.stack([1 / (1 + 2 * t), 1 / (1 - t), 1 / (1 - t)], axis=1), axis=1)
    np.testing.assert_allclose(v.sphere_min, factors[:, 0], rtol=1e-9)
    np.testing.assert_allclose(v.sphere_max, factors[:, 2], rtol=1e-9)
    np.testing.assert_allclose(v.cube_max[2], np.sqrt(3))
    assert v.sphere_max[0] == pytest.approx(2.244, abs=1e-3)


@pytest.mark.parametrize("name", machine_names())
def test_jacobian_against_forward_kinematics(name):
    """Central differences of closed positions, observed order two."""
    machine = sm.load_machine(name)
    low, high = machine.workspace
    p = (low + high) / 2 + 0.2 * (high - low) * np.array([0.3, -0.2, 0.1])
    k = drive_kinematics(machine, p)
    assert k.status == sm.Status.CONVERGED
    errors = []
    for h in (4e-3, 2e-3):
        steps = h * np.eye(len(machine.actuators))
        ahead = sm.forward_kinematics(machine, k.actuators + steps)
        behind = sm.forward_kinematics(machine, k.actuators - steps)
        errors.append(np.abs((ahead.position - behind.position).T / (2 * h) - k.jacobian[:3]).max())
    assert errors[1] < 1e-4
    assert errors[1] < 1e-9 or errors[0] / errors[1] == pytest.approx(4, rel=0.1)


@pytest.mark.parametrize("name", ["orthoglide-revised", "hexapod", "ur10", "rotary-delta"])
def test_hexagon_against_directions_one_by_one(name):
    machine = sm.load_machine(name)
    p = machine.workspace.mean(axis=0) + [0.02, 0.03, -0.01]
    h = sm.velocity_section(machine, p, plane="xy")
    j = drive_kinematics(machine, p).jacobian
    inverse = np.linalg.pinv(j)[:, :2]
    angle = np.linspace(0, 2 * np.pi, 40001)
    reach = 1 / np.abs(inverse @ np.stack([np.cos(angle), np.sin(angle)])).max(axis=0)
    assert float(h.inner) == pytest.approx(reach.min(), rel=1e-6)
    assert float(h.outer) == pytest.approx(reach.max(), rel=1e-3)
    assert float(h.outer) >= reach.max() * (1 - 1e-12)
    np.testing.assert_allclose(np.abs(inverse @ h.vertices.T).max(axis=0), 1, rtol=1e-9)


def test_hexagon_has_six_corners_where_all_drives_count():
    h = sm.velocity_section(sm.load_machine("orthoglide-revised"), [0.2, 0.25, 0.3], plane="xy")
    assert len(np.unique(np.round(h.vertices, 9), axis=0)) in (4, 6)
    area = 0.5 * np.sum(
        h.vertices[:, 0] * np.roll(h.vertices[:, 1], -1) - h.vertices[:, 1] * np.roll(h.vertices[:, 0], -1)
    )
    assert area > 0


def test_characteristic_length_changes_only_machines_that_turn():
    p = {"orthoglide-revised": [0.1, 0.0, 0.1], "hexapod": [0.05, 0.0, 0.7]}
    ratio = {}
    for name, at in p.items():
        machine = sm.load_machine(name)
        a, b = (sm.velocity_transmission(machine, at, length=x).condition for x in (0.3, 0.6))
        ratio[name] = a / b
    assert ratio["orthoglide-revised"] == pytest.approx(1, rel=1e-9)
    assert abs(ratio["hexapod"] - 1) > 0.05


@pytest.mark.parametrize("name", ["orthoglide-revised", "hexapod", "ur10"])
def test_accuracy_is_the_worst_corner_also_without_linearising(name):
    machine = sm.load_machine(name)
    p = machine.workspace.mean(axis=0) + [0.02, 0.03, -0.01]
    sizes = []
    for e in (2e-4, 1e-4):
        a = sm.accuracy_transmission(machine, p, errors=e, nonlinear=True)
        sizes.append(abs(float(a.nonlinear - a.translation)))
        inside = RNG.uniform(-e, e, (500, len(machine.actuators)))
        j = drive_kinematics(machine, p).jacobian[:3]
        assert np.linalg.norm(inside @ j.T, axis=1).max() <= a.translation
    assert sizes[0] / sizes[1] == pytest.approx(4, rel=0.1)  # second order


def test_declared_encoder_errors_of_the_shipped_machine():
    a = sm.accuracy_transmission(sm.load_machine("orthoglide-revised"), [0.0, 0.0, 0.0])
    assert float(a.translation) == pytest.approx(np.sqrt(3) * 2e-6)


@pytest.mark.parametrize("name", ["orthoglide-revised", "ur10", "hexapod"])
def test_force_transmission_against_solved_efforts(name):
    """Efforts of a loaded solution of a very stiff machine are -J^T f, and the polygon holds them all."""
    machine = sm.load_machine(name)
    p = machine.workspace.mean(axis=0) + [0.02, 0.03, -0.01]
    f = sm.force_transmission(machine, p, limits=1.0)
    small = 1e-3  # N, so that deflections do not change the geometry
    angle = np.linspace(0, 2 * np.pi, 721)[:-1]
    wrench = np.zeros((720, 6))
    wrench[:, 0], wrench[:, 1] = small * np.cos(angle), small * np.sin(angle)
    effort = machine.solve(p, wrench).actuator_effort
    held = small / np.abs(effort).max(axis=1)
    assert float(f.plane.inner) == pytest.approx(held.min(), rel=1e-4)
    assert float(f.plane.outer) == pytest.approx(held.max(), rel=1e-2)


def test_gravity_counts_against_the_drives():
    machine = sm.load_machine("orthoglide-revised")
    free, heavy = (sm.force_transmission(machine, [0.1, 0, 0], gravity=g) for g in ([0, 0, 0], [0, 0, -9.81]))
    still = machine.solve([0.1, 0, 0], gravity=[0, 0, -9.81]).actuator_effort
    np.testing.assert_allclose(heavy.bias, still, rtol=2e-3, atol=0.3)
    assert heavy.force_min < free.force_min


def test_failed_poses_are_nan_with_their_status():
    machine = sm.load_machine("orthoglide-revised")
    v = sm.velocity_transmission(machine, [[0, 0, 0], [2.0, 0, 0]])
    assert list(v.status) == [sm.Status.CONVERGED, sm.Status.UNREACHABLE]
    assert np.isnan(v.sphere_min[1]) and np.isnan(v.cube_max[1]) and not np.isnan(v.sphere_min[0])
    far = [[0, 0, 0], [2.0, 0, 0]]
    bias, corner = sm.force_transmission(machine, far).bias, sm.accuracy_transmission(machine, far).corner
    response = sm.frequency_response(machine, far, [10.0], damping=0.02).values
    for found in (bias, corner, response.real, response.imag):
        assert np.isfinite(found[0]).all() and np.isnan(found[1]).all()


@pytest.mark.parametrize("bad", [-1.0, 0.0, float("nan")])
def test_a_bad_length_is_refused(bad):
    with pytest.raises(sm.StiffmapError, match="length"):
        sm.velocity_transmission(sm.load_machine("hexapod"), [0, 0, 0.7], length=bad)


def test_undeclared_speeds_name_the_actuators():
    with pytest.raises(sm.StiffmapError, match=r"no speed declared for .*base"):
        sm.velocity_transmission(sm.load_machine("ur10"), [-0.8, 0, 0.3], limits="declared")


@pytest.mark.parametrize("name", ["orthoglide-revised", "hexapod", "five-bar", "ur10"])
def test_poses_continued_from_their_starts_alone(name):
    """Neighbours lead to the same answer as closing from home; a start is asked for, and a false one is refused."""
    machine = sm.load_machine(name)
    low, high = machine.workspace
    p = RNG.uniform(low, high, (30, 3))
    k = drive_kinematics(machine, p)
    p, x = p[k.status == sm.Status.CONVERGED], k.coordinates[k.status == sm.Status.CONVERGED]
    step = 0.02 * (high - low)
    near = drive_kinematics(machine, p + step, start=x, only_start=True)
    both = (near.status == sm.Status.CONVERGED) & (drive_kinematics(machine, p + step).status == 0)
    assert both.mean() > 0.9
    back = drive_kinematics(machine, p[both], start=near.coordinates[both], only_start=True)
    np.testing.assert_allclose(back.coordinates, x[both], atol=1e-8)
    lost = drive_kinematics(machine, p, start=np.full_like(x, np.nan), only_start=True)
    assert (lost.status == sm.Status.UNREACHABLE).all()
    with pytest.raises(sm.StiffmapError, match="only_start: needs start"):
        drive_kinematics(machine, p, only_start=True)


ARM = """
name: arm
units: {length: mm, force: N, angle: deg}
home: {translation: [700, 0, 900], solve: true}
task: [x, y, z]
legs:
  arm:
    elements:
      - {actuator: j1, kind: revolute, axis: z, compliance: 1.0e-8}
      - {offset: column, translation: [0, 0, 600]}
      - {actuator: j2, kind: revolute, axis: -y, home: 70, compliance: 1.2e-8}
      - {offset: upper, translation: [500, 0, 0]}
      - {actuator: j3, kind: revolute, axis: y, home: 100, compliance: 3.0e-8}
      - {offset: fore, translation: [550, 0, 0]}
"""
COMMANDED = {
    "five-bar": [0.03, 0.42, 0.0],
    "hybrid": [0.02, 0.03, 0.0],
    ARM: [0.69, 0.02, 0.93],
    "3-rrr": [0.02, 0.01, 0],
}


@pytest.mark.parametrize("name", COMMANDED, ids=lambda name: name.strip().partition("\n")[0])
def test_speeds_in_a_plane_are_the_slopes_of_the_drives(name):
    """What the closure decides, as the turn of a forearm, is free: rates by central differences of inverse kinematics."""
    machine = sm.load_machine(machine_text(name, "planar", {}) if name == "3-rrr" else name)
    p = np.array(COMMANDED[name])
    if name in ("hybrid", "3-rrr"):
        p += machine.description.home.p
    steps = 1e-6 * np.eye(3)[:2]
    ahead, behind = (sm.inverse_kinematics(machine, p + s * steps).actuators for s in (1, -1))
    rates = (ahead - behind).T / 2e-6
    angle = np.linspace(0, 2 * np.pi, 7201)
    radius = 1 / np.abs(rates @ [np.cos(angle), np.sin(angle)]).max(axis=0)
    found = sm.velocity_section(machine, p)
    assert found.inner == pytest.approx(radius.min(), rel=1e-5)
    assert found.outer == pytest.approx(radius.max(), rel=2e-3)


@pytest.mark.parametrize("name", ["five-bar", "hybrid", "orthoglide-revised"])
def test_acceleration_asks_a_drive_for_all_it_has(name):
    machine, most = sm.load_machine(name), 50.0
    commanded = [i for i, c in enumerate("xyz") if c in machine.description.task]
    k = drive_kinematics(machine, machine.description.home.p + np.array([0.01, 0.02, 0.0]))
    reached = float(acceleration_of(machine, k, efforts=most, gravity=[0, 0, 0]))
    away = np.zeros((4000, 6))
    away[:, commanded] = np.random.default_rng(0).normal(size=(4000, len(commanded)))
    away *= reached / np.linalg.norm(away, axis=1)[:, None]
    still = np.zeros_like(away)
    efforts = rigid_dynamics(machine, np.tile(k.coordinates, (4000, 1)), still, away, still, [0, 0, 0])[
        "effort"
    ]
    assert 0.98 * most < np.abs(efforts).max() <= (1 + 1e-9) * most


@pytest.mark.parametrize(("name", "plane"), [("3-rps", "xy"), ("five-bar", "xz"), ("swing-table", "xy")])
def test_planes_that_are_not_commanded_have_no_speed(name, plane):
    machine = sm.load_machine(name)
    with pytest.raises(sm.StiffmapError, match=rf"{name}: plane: expected commanded axes .*got {plane}"):
        sm.velocity_section(machine, machine.description.home.p, plane=plane)
    held = sm.force_transmission(
        machine, machine.description.home.p, plane=plane, limits=1.0, gravity=[0, 0, 0]
    ).plane
    assert held.outer == np.inf and held.inner > 0.5  # legs hold across what drives move


def test_a_pose_that_drives_do_not_hold_has_no_force():
    held = sm.force_transmission("hexapod", [0, 0, 0.7], limits=1.0, gravity=[0, 0, -9.81]).plane
    assert held.inner == 0.0 and held.outer == 0.0

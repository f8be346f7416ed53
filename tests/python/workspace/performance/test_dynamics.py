"""Inverse dynamics and natural frequencies against MuJoCo's trees, energy and closed forms."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from scipy.interpolate import make_interp_spline

import stiffmap as sm
from stiffmap.model.description import Body, ExternalSpring, Offset, Point
from stiffmap.workspace.performance import fastest, line, timed
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.efforts import acceleration_of

GRAVITY = [0.0, 0.0, -9.81]
PATHS = {
    "orthoglide-revised": ([-0.1, 0, 0], [0.2, 0.1, -0.1]),
    "linear-delta": ([-0.05, 0, 0.25], [0.05, 0.08, 0.35]),
    "rotary-delta": ([-0.1, 0, -0.7], [0.1, 0.1, -0.65]),
    "hexapod": ([-0.05, 0, 0.68], [0.05, 0.08, 0.72]),
    "ur10": ([-0.9, -0.2, 0.2], [-0.7, 0.1, 0.4]),
}


def engine():
    pytest.importorskip("mujoco")
    spec = importlib.util.spec_from_file_location("mujoco_tree", Path(__file__).with_name("mujoco_tree.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", PATHS)
def test_work_of_the_drives_is_the_change_of_energy(name):
    machine = sm.load_machine(name)
    t = timed(line(*PATHS[name], 401), 0.8)
    d = sm.drive_efforts(machine, t, gravity=GRAVITY, friction=False)
    energy = (d.kinetic + d.potential).values
    power = make_interp_spline(t.time, d.power.sum("drive").values, k=7)
    size = np.ptp(energy)
    for i in (100, 200, 300, 400):
        assert power.integrate(0, t.time[i]) == pytest.approx(energy[i] - energy[0], abs=1e-9 * size)


@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "hexapod", "ur10"])
def test_efforts_against_mujoco_with_loops_closed(name):
    machine = sm.load_machine(name)
    t = timed(line(*PATHS[name], 21), 0.5)
    d = sm.drive_efforts(machine, t, gravity=GRAVITY, friction=False)
    k = drive_kinematics(machine, t.position)
    tree = engine().Tree(machine, springs=False, gravity=GRAVITY)
    names = machine.compiled.names.coordinates
    held = [tree.index(n) for n in machine.free_spins]
    free = [i for i in range(tree.model.nv) if i not in held]
    drives = [tree.index(n) for n in machine.actuators]
    h = 1e-5
    for i in (5, 10, 15):
        x = dict(zip(names, k.coordinates[i], strict=True))

        def motion(s, i=i):
            """All rates of the tree for the tip's motion at time t + s, by MuJoCo's Jacobians."""
            p = t.position[i] + s * t.velocity[i] + s * s / 2 * t.acceleration[i]
            at = drive_kinematics(machine, p)
            tree.put(dict(zip(names, at.coordinates, strict=True)))
            A = np.vstack([tree.jacobian(tree.tip), tree.loop_jacobian()])[:, free]
            rate = np.zeros(tree.model.nv)
            v = np.concatenate([t.velocity[i] + s * t.acceleration[i], np.zeros(3 + 6 * len(tree.loops))])
            rate[free] = np.linalg.lstsq(A, v, rcond=1e-10)[0]
            return rate

        acceleration = (motion(h) - motion(-h)) / (2 * h)
        rate = motion(0.0)
        tree.put(x)
        force = tree.inverse(rate, acceleration)
        passive = [j for j in free if j not in drives]
        J = tree.loop_jacobian()
        follow = np.zeros((tree.model.nv, len(drives)))
        follow[drives, range(len(drives))] = 1
        if len(J):
            follow[passive] = -np.linalg.lstsq(J[:, passive], J[:, drives], rcond=1e-10)[0]
        expected = follow.T @ force
        scale = np.abs(expected).max()
        np.testing.assert_allclose(d.effort.values[i], expected, atol=2e-6 * scale)


def with_links(name):
    """The tripteron declares no mass: its round aluminium links get theirs."""
    if name != "tripteron":
        return sm.load_machine(name)
    mass = 2700 * np.pi * 0.15**2 / 4 * 0.75
    across = mass * (0.75**2 / 12 + 0.15**2 / 16)
    inertia = ((mass * 0.15**2 / 8, 0.0, 0.0), (0.0, across, 0.0), (0.0, 0.0, across))
    d = sm.load_machine(name).description

    def heavy(elements):
        out = []
        for e in elements:
            if isinstance(e, Offset) and e.name.endswith("_length"):
                out.append(Body(e.name[:-7] + "_body", mass, (0.375, 0.0, 0.0), inertia))
            out.append(e)
        return tuple(out)

    legs = tuple(replace(leg, elements=heavy(leg.elements)) for leg in d.legs)
    tool = Body("tool", 5.0, inertia=((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.015)))
    return sm.Machine(replace(d, legs=legs, platform=(*d.platform, tool)))


@pytest.mark.parametrize("name", sm.machine_names())
def test_frequencies_against_mujoco(name):
    machine = with_links(name)
    low, high = machine.workspace
    aside = np.where(high - low > 0.01, np.array([0.01, -0.02, 0.015]), 0.0)
    p = (low + high) / 2 + aside
    found = sm.natural_frequencies(machine, p, gravity=[0, 0, 0], modes=4)
    assert found.status == sm.Status.CONVERGED
    k = drive_kinematics(machine, p)
    x = dict(zip(machine.compiled.names.coordinates, k.coordinates, strict=True))
    tree = engine().Tree(machine, springs=True, x=x)
    tree.put(x)
    stiffness = np.zeros((tree.model.nv, tree.model.nv))
    group = {}
    for joint, row in zip(tree.names, tree.stiffness, strict=True):
        i = tree.index(joint)
        if np.ndim(row) == 0:
            stiffness[i, i] = row
        else:
            group.setdefault(joint.rsplit(".", 1)[0], []).append((i, row))
    for rows in group.values():
        index = [i for i, _ in rows]
        stiffness[np.ix_(index, index)] = np.array([row for _, row in rows])
    free = [i for i in range(tree.model.nv) if i not in [tree.index(n) for n in machine.free_spins]]
    J = tree.loop_jacobian()[:, free]
    scale = np.ones(J.shape[1])
    Z = scipy.linalg.null_space(J, rcond=1e-9) if len(J) else np.diag(scale)
    K = Z.T @ stiffness[np.ix_(free, free)] @ Z
    M = Z.T @ tree.mass()[np.ix_(free, free)] @ Z
    mu = scipy.linalg.eigh(M, K, eigvals_only=True)[::-1][:4]
    expected = 1 / np.sqrt(mu) / (2 * np.pi)
    some = expected < 1e5  # beyond are the tiny inertias that MuJoCo wants of points
    assert some.sum() >= 3 and np.isnan(found.frequency[~some]).all()
    np.testing.assert_allclose(found.frequency[some], expected[some], rtol=1e-6)


def test_peak_acceleration_at_the_isotropic_point():
    """There each drive moves one carriage, one pair of bars and the platform along its own axis."""
    machine = sm.load_machine("orthoglide-revised")
    reached = acceleration_of(machine, drive_kinematics(machine, [0.0, 0.0, 0.0]))
    # along x: carriage 5, bars 2 x 2.4 along x; the two other legs' bars swing: half of each carriage end
    mass = 5 + 4.8 + 6 + 2 * 4.8 / 3
    assert float(reached) == pytest.approx(2000 / mass, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "position"),
    [
        ("orthoglide-revised", [0.1, 0.05, -0.1]),
        ("rotary-delta", [0.05, -0.02, -0.68]),
        ("tripteron", [0.3, 0.4, 0.5]),
    ],
)
def test_drives_hold_springs_without_gravity(name, position):
    """Virtual work of the spring by hand; the tripteron has no masses at all."""
    plain = sm.load_machine(name)
    anchor, p = np.array([0.1, -0.2, 1.5]), np.array(position)
    spring = ExternalSpring("balancer", "platform.hook", tuple(anchor), 100.0, 0.2)
    d = plain.description
    machine = sm.Machine(
        replace(d, platform=(*d.platform, Point("hook", (0.0, 0.0, 0.0))), external_springs=(spring,))
    )
    line = anchor - p
    pull = 100.0 * (1 - 0.2 / np.linalg.norm(line)) * line
    found = sm.force_transmission(machine, p, limits=1e4, gravity=[0, 0, 0])
    j = sm.velocity_transmission(machine, p).jacobian[:3]
    np.testing.assert_allclose(found.bias, -j.T @ pull, rtol=1e-9, atol=1e-9 * np.abs(pull).max())
    assert found.force_min < 0.999 * sm.force_transmission(plain, p, limits=1e4, gravity=[0, 0, 0]).force_min


def test_time_optimal_path_keeps_all_limits_and_uses_one():
    machine = sm.load_machine("orthoglide-revised")
    t = fastest(machine, line(*PATHS["orthoglide-revised"], 201))
    d = sm.drive_efforts(machine, t)
    use = np.maximum((np.abs(d.effort) / 2000).max("drive"), (np.abs(d.rate) / 2.0).max("drive")).values[1:-1]
    assert use.max() <= 1 + 1e-6
    assert np.median(use) > 0.9  # bang-bang, less what friction is charged ahead
    slow = timed(line(*PATHS["orthoglide-revised"], 201), float(t.time[-1]))
    assert float(sm.drive_efforts(machine, slow).peak_speed.max()) > 2.0  # the same time, not optimally


def test_machine_without_masses_is_refused_by_name():
    with pytest.raises(sm.StiffmapError, match=r"tripteron: a natural frequency needs masses.*legs 1, 2, 3"):
        sm.natural_frequencies(sm.load_machine("tripteron"), [0.3, 0.4, 0.5])


def test_trajectory_that_leaves_the_reach_says_where_and_when():
    t = timed(line([0, 0, 0], [0.9, 0, 0], 101), 1.0)
    with pytest.raises(sm.StiffmapError, match=r"leaves the reach at \(.*\) mm, t = 0\.\d+ s"):
        sm.drive_efforts(sm.load_machine("orthoglide-revised"), t)

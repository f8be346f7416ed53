"""Drives that outnumber the freedoms (a gantry with two on one axis, three cranks on a point) or the tool's motions (an
arm of seven axes): what each does, against closed forms (docs/theory.md D10)."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog
from tests.python.solve.redundant_machines import (
    BRIDGE,
    MASS,
    STIFF,
    Arm,
    cranks,
    rates_of_cranks,
    seven_axes,
    three_cranks,
    twin_gantry,
)

import stiffmap as sm
from stiffmap.workspace.performance import fastest, line
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.trajectory import timed

POINT = np.array([0.04, -0.03])


@pytest.fixture(scope="module")
def gantry() -> sm.Machine:
    return twin_gantry()


@pytest.fixture(scope="module")
def plane() -> sm.Machine:
    return three_cranks((4e4, 6e4, 1e5))


@pytest.fixture(scope="module")
def arm() -> Arm:
    return seven_axes()


def at(machine: sm.Machine, name: str) -> int:
    return machine.actuators.index(name)


def test_one_axis_of_two_drives(gantry: sm.Machine) -> None:
    p = [0.1, -0.2, 0.31]
    y = [at(gantry, "y1.drive"), at(gantry, "y2.drive")]
    v = sm.velocity_transmission(gantry, p)
    np.testing.assert_allclose(v.jacobian[1, y], [0.5, 0.5], atol=1e-12)
    # both turn at the bridge's speed: rates (1, 1) of length root 2
    np.testing.assert_allclose([v.sphere_min, v.sphere_max], [np.sqrt(0.5), 1.0], rtol=1e-12)
    np.testing.assert_allclose([v.cube_min, v.manipulability], [1.0, np.sqrt(0.5)], rtol=1e-12)
    k = drive_kinematics(gantry, p, sharing="stiffness")
    np.testing.assert_allclose(k.jacobian[1, y], np.array(STIFF) / sum(STIFF), rtol=1e-12)
    assert k.together == 3


@pytest.mark.parametrize("sharing", ["least_norm", "stiffness"])
def test_efforts_of_two_drives_on_one_axis(gantry: sm.Machine, sharing: str) -> None:
    trajectory = timed(line([-0.2, -0.1, 0.25], [0.1, 0.25, 0.35]), 0.8)
    e = sm.drive_efforts(gantry, trajectory, sharing=sharing, friction=False)
    share = np.array(STIFF) / sum(STIFF) if sharing == "stiffness" else np.array([0.5, 0.5])
    for name, part in zip(("y1.drive", "y2.drive"), share, strict=True):
        wanted = part * (BRIDGE + 6.0) * trajectory.acceleration[:, 1]
        np.testing.assert_allclose(e.effort.sel(drive=name), wanted, atol=1e-9 * np.abs(wanted).max())
        np.testing.assert_allclose(e.rate.sel(drive=name), trajectory.velocity[:, 1], atol=1e-12)
    x = next(n for n in gantry.actuators if n.endswith("x"))
    np.testing.assert_allclose(e.effort.sel(drive=x), 6.0 * trajectory.acceleration[:, 0], atol=1e-9)


def test_what_two_drives_hold_and_how_exactly(gantry: sm.Machine) -> None:
    p = [0.0, 0.1, 0.3]
    f = sm.force_transmission(gantry, p, limits=100.0)
    assert f.force_min == pytest.approx(100.0, rel=1e-12)  # x and z hold 100 N, y 200 N
    shared = sm.force_transmission(gantry, p, limits=[100.0, 100.0, 1e6, 1e6], sharing="stiffness")
    assert shared.force_min == pytest.approx(100.0 * sum(STIFF) / max(STIFF), rel=1e-12)
    a = sm.accuracy_transmission(gantry, p, errors=[3e-5, 1e-5, 0.0, 0.0], nonlinear=True)
    np.testing.assert_allclose([a.translation, a.nonlinear], 2e-5, rtol=1e-6)
    weighted = sm.accuracy_transmission(gantry, p, errors=[3e-5, 1e-5, 0.0, 0.0], sharing="stiffness")
    assert weighted.translation == pytest.approx((3e-5 * STIFF[0] + 1e-5 * STIFF[1]) / sum(STIFF), rel=1e-12)


def test_a_mismatch_is_a_preload(gantry: sm.Machine) -> None:
    """The zero of one drive is off by d: the drives push against each other with d k1 k2 / (k1 + k2)."""
    d = 4e-5
    off = gantry.with_effect("zero_offset", element="drive", legs=["y1"], error=d)
    for method in ("fast", "reference"):
        s = off.solve(gantry.description.home.p, method=method)
        push = d * STIFF[0] * STIFF[1] / sum(STIFF)
        efforts = s.actuator_effort[[at(gantry, "y1.drive"), at(gantry, "y2.drive")]]
        np.testing.assert_allclose(efforts, [push, -push], rtol=1e-9)
        assert s.displacement[1] == pytest.approx(d * STIFF[0] / sum(STIFF), rel=1e-9)


@pytest.mark.parametrize("sharing", ["least_norm", "stiffness"])
def test_three_cranks_on_a_point(plane: sm.Machine, sharing: str) -> None:
    a = rates_of_cranks(POINT)
    w = np.diag([4e4, 6e4, 1e5]) if sharing == "stiffness" else np.eye(3)
    j = np.linalg.solve(a.T @ w @ a, a.T @ w)
    k = drive_kinematics(plane, [*POINT, 0.0], sharing=sharing)
    np.testing.assert_allclose(k.jacobian[:2], j, rtol=1e-9)
    assert k.together == 2
    np.testing.assert_allclose(k.actuators, cranks(POINT)[0], atol=1e-12)
    f = sm.force_transmission(plane, [*POINT, 0.0], limits=5.0, sharing=sharing)
    corner = f.plane.vertices[0]
    assert np.abs(j.T @ corner).max() == pytest.approx(5.0, rel=1e-9)
    errors = np.array([1e-5, 3e-5, 2e-5])
    found = sm.accuracy_transmission(plane, [*POINT, 0.0], errors=errors, sharing=sharing)
    worst = max(np.linalg.norm(j @ (errors * s)) for s in product((1, -1), repeat=3))
    assert found.translation == pytest.approx(worst, rel=1e-9)


def test_speeds_of_three_cranks(plane: sm.Machine) -> None:
    """Only rates that go together count: singular values of the rates per velocity, the other way round."""
    a = rates_of_cranks(POINT)
    v = sm.velocity_transmission(plane, [*POINT, 0.0], part="translation")
    s = np.linalg.svd(a * plane.compiled.length, compute_uv=False)
    np.testing.assert_allclose([v.sphere_max, v.sphere_min], [1 / s[1], 1 / s[0]], rtol=1e-9)


@pytest.mark.parametrize("sharing", ["least_norm", "stiffness"])
def test_efforts_of_three_cranks(plane: sm.Machine, sharing: str) -> None:
    """A mass on a point: each freedom's force is m a, shared; accelerations of the cranks by differences of theirs."""
    trajectory = timed(line([-0.05, 0.02, 0.0], [0.06, -0.04, 0.0], 41), 0.3)
    e = sm.drive_efforts(plane, trajectory, sharing=sharing, friction=False)
    w = np.diag([4e4, 6e4, 1e5]) if sharing == "stiffness" else np.eye(3)
    step = 1e-4
    for i in (3, 20, 33):
        p, v, acc = (x[i, :2] for x in (trajectory.position, trajectory.velocity, trajectory.acceleration))
        a = rates_of_cranks(p)
        np.testing.assert_allclose(e.rate[i], a @ v, rtol=1e-9, atol=1e-12)
        wanted = w @ a @ np.linalg.solve(a.T @ w @ a, MASS * acc)
        np.testing.assert_allclose(e.effort[i], wanted, rtol=1e-8, atol=1e-12)
        slope = (rates_of_cranks(p + step * v) @ v - rates_of_cranks(p - step * v) @ v) / (2 * step)
        np.testing.assert_allclose(e.acceleration[i], a @ acc + slope, rtol=1e-5, atol=1e-9)


def test_speeds_of_an_arm_of_seven_axes(arm: Arm) -> None:
    """The speed reached in every direction, the rest of the twist zero: linear programmes in some directions bound it,
    and one of them reaches it."""
    m, p = arm.machine, arm.tip(arm.home)[0]
    v = sm.velocity_transmission(m, p)
    j = arm.jacobian(arm.home)
    unit = np.array([1.0] * 3 + [m.compiled.length] * 3)
    s = np.linalg.svd(unit[:, None] * j / m.compiled.length, compute_uv=False)
    np.testing.assert_allclose([v.sphere_max, v.sphere_min], [s[0], s[5]], rtol=1e-7)

    def fastest_along(d: np.ndarray) -> float:
        """Largest t with J u = t d, |u| <= 1."""
        found = linprog(
            np.eye(8)[7] * -1, A_eq=np.hstack([unit[:, None] * j / m.compiled.length, -d[:, None]]),
            b_eq=np.zeros(6), bounds=[(-1, 1)] * 7 + [(0, None)],
        )  # fmt: skip
        return float(-found.fun)

    rng = np.random.default_rng(4)
    seen = min(fastest_along(d / np.linalg.norm(d)) for d in rng.normal(size=(200, 6)))
    assert v.cube_min <= seen * (1 + 1e-9)
    from stiffmap.workspace.performance.motion.many_drives import facets

    normals, distance = facets(unit[:, None] * j / m.compiled.length, 6)
    weakest = normals[np.argmin(distance)]
    assert fastest_along(weakest) == pytest.approx(float(v.cube_min), rel=1e-7)


def test_section_of_an_arm_of_seven_axes(arm: Arm) -> None:
    m, p = arm.machine, arm.tip(arm.home)[0]
    section = sm.velocity_section(m, p)
    j = arm.jacobian(arm.home)
    for angle in np.linspace(0.1, 6.0, 9):
        d = np.array([np.cos(angle), np.sin(angle), 0, 0, 0, 0])
        found = linprog(
            -np.eye(8)[7], A_eq=np.hstack([j, -d[:, None]]), b_eq=np.zeros(6),
            bounds=[(-1, 1)] * 7 + [(0, None)],
        )  # fmt: skip
        edges = section.vertices
        far = [
            np.linalg.solve(np.stack([d[:2], a - b], axis=1), a)
            for a, b in zip(edges, np.roll(edges, -1, axis=0), strict=True)
            if np.linalg.norm(a - b) > 1e-12
        ]
        hit = min(t for t, s in far if t > 0 and -1e-9 <= s <= 1 + 1e-9)
        assert hit == pytest.approx(-found.fun, rel=1e-7)


def test_efforts_of_an_arm_of_seven_axes(arm: Arm) -> None:
    """The joints are those nearest to home all along, so that rates are theirs; power is the change of energy."""
    p = arm.tip(arm.home)[0]
    trajectory = timed(line(p - [0.05, 0.02, 0.0], p + [0.06, 0.05, -0.04], 401), 0.6)
    e = sm.drive_efforts(arm.machine, trajectory, gravity=[0, 0, -9.81], friction=False)
    joints = sm.inverse_kinematics(arm.machine, trajectory.position).actuators
    np.testing.assert_allclose(e.coordinate, joints, atol=1e-9)
    dt = trajectory.time[1] - trajectory.time[0]
    inner = slice(2, -2)

    def slope(x: np.ndarray) -> np.ndarray:
        return np.asarray(8 * (x[3:-1] - x[1:-3]) - (x[4:] - x[:-4])) / (12 * dt)

    size = np.abs(e.rate.values).max()
    np.testing.assert_allclose(e.rate.values[inner], slope(joints), atol=2e-6 * size)
    size = np.abs(e.acceleration.values).max()
    np.testing.assert_allclose(e.acceleration.values[inner], slope(e.rate.values), atol=1e-5 * size)
    energy = slope(e.kinetic.values + e.potential.values)
    power = e.power.values.sum(axis=1)
    np.testing.assert_allclose(power[inner], energy, atol=1e-5 * np.abs(power).max())


def test_a_quick_run_keeps_the_limits_of_seven_axes(arm: Arm) -> None:
    p = arm.tip(arm.home)[0]
    run = fastest(arm.machine, line(p, p + [0.05, 0.03, -0.02], 61), gravity=[0, 0, -9.81])
    e = sm.drive_efforts(arm.machine, run, gravity=[0, 0, -9.81])
    assert (e.peak_speed.values <= 1.0 + 1e-6).all()
    most = (np.abs(e.rate.values) / 1.0).max()
    assert most > 0.99 or (np.abs(e.effort.values) / 200.0).max() > 0.99


def test_words(gantry: sm.Machine) -> None:
    with pytest.raises(
        sm.StiffmapError, match="sharing: expected one of least_norm, stiffness, got 'evenly'"
    ):
        sm.drive_efforts(gantry, timed(line([0, 0, 0.3], [0.1, 0, 0.3]), 1.0), sharing="evenly")


def test_measures_of_all(gantry: sm.Machine, plane: sm.Machine, arm: Arm) -> None:
    """Measures have their numbers: no drive that goes along with another makes a factor zero."""
    for machine in (gantry, plane, arm.machine):
        chosen = ("transmission_min", "condition", "singularity", "force", "accuracy")
        table = sm.measures(machine, nodes=3, coarse=2, only=chosen)
        worst = {r.measure.name: r.found.worst for r in table.rows}
        assert worst["transmission_min"] > 0.01, machine.name
        assert np.isfinite(list(worst.values())).all(), machine.name

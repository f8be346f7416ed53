"""The four kinds of singular pose, kept apart (docs/conventions.md)."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Joint, Law, Pose

METHODS = ("fast", "reference")
ALONG = ("x", "y", "z")


def ball(name: str) -> Joint:
    return Joint(name, "spherical", tuple(b.AXES[a] for a in ALONG), home=(0.0, 0.0, 0.0))


def strut(anchor: np.ndarray, target: np.ndarray, k: float) -> tuple[object, ...]:
    """A leg between two ball joints with a motor along it: it may spin about itself."""
    way = target - anchor
    length = float(np.linalg.norm(way))
    z = way / length
    x = np.cross((0.3, 0.5, 0.8), z)
    x /= np.linalg.norm(x)
    r = np.column_stack([x, np.cross(z, x), z])
    return (
        b.Offset("foot", Pose.of(anchor, r)),
        ball("lower"),
        b.slider("motor", "z", length, Law(k)),
        ball("upper"),
        b.Offset("head", Pose.of((0, 0, 0), r.T)),
        b.Offset("to_centre", Pose.of(np.array(HOME.p) - target)),
    )


HOME = Pose.of((0.0, 0.0, 0.6))
TURNS = np.deg2rad([20, 100, 140, 220, 260, 340])
BASE = np.column_stack([0.5 * np.cos(TURNS), 0.5 * np.sin(TURNS), np.zeros(6)])
TOPS = TURNS + np.deg2rad([30, -30, 30, -30, 30, -30])
TOP = np.column_stack([0.3 * np.cos(TOPS), 0.3 * np.sin(TOPS), np.full(6, 0.6)])
K = 2e7


@pytest.fixture(scope="module")
def hexapod() -> sm.Machine:
    return b.parallel(*(strut(f, h, K) for f, h in zip(BASE, TOP, strict=True)), home=HOME)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", METHODS)
def test_struts_may_spin_and_the_platform_is_stiff(hexapod: sm.Machine, method: str) -> None:
    assert len(hexapod.free_spins) == 6
    assert {name.split(".")[0] for name in hexapod.free_spins} == set(hexapod.legs)
    s = hexapod.solve(HOME.p, method=method)
    assert int(s.status) == sm.Status.CONVERGED
    assert int(s.flags) & sm.Flag.FREE_SPIN
    assert set(s.indeterminate) == set(hexapod.free_spins)
    along = (TOP - BASE) / np.linalg.norm(TOP - BASE, axis=1)[:, None]
    rows = np.column_stack([along, np.cross(TOP - HOME.p, along)])
    np.testing.assert_allclose(s.stiffness, K * rows.T @ rows, rtol=1e-8, atol=1e-3)


def test_strut_forces_are_axial(hexapod: sm.Machine) -> None:
    load = np.array([100.0, -200, 500, 10, 20, -30])
    s = hexapod.solve(HOME.p, load)
    along = (TOP - BASE) / np.linalg.norm(TOP - BASE, axis=1)[:, None]
    rows = np.column_stack([along, np.cross(TOP - HOME.p, along)])
    effort = np.linalg.solve(rows.T, -load)  # drive on the leg, hence leg on platform
    np.testing.assert_allclose(s.actuator_effort, effort, rtol=1e-3)
    np.testing.assert_allclose(s.leg_wrench[:, :3], effort[:, None] * along, rtol=1e-3, atol=0.2)


@pytest.mark.parametrize("method", METHODS)
def test_free_twist_of_the_platform(method: str) -> None:
    """A link with a pin at its end: the platform turns freely about the pin."""
    rng = np.random.default_rng(1)
    pin_at = np.array([0.1, -0.2, 0.0])
    machine = b.serial(
        b.stiff("link", b.random_spd(rng)),
        b.shift("to_pin", pin_at),
        b.revolute("pin", "z"),
        b.shift("tool", (0.3, 0, 0)),
        home=Pose.of((0.4, -0.2, 0)),
    )
    s = machine.solve((0.4, -0.2, 0), (10.0, 0, 0, 0, 0, 0), method=method)
    assert int(s.status) == sm.Status.SINGULAR
    assert int(s.flags) & sm.Flag.PLATFORM_SINGULAR
    free = s.free_twists[:, 0] / s.free_twists[5, 0]
    np.testing.assert_allclose(free, [0, 0.3, 0, 0, 0, 1], atol=1e-8)
    assert np.isnan(s.free_twists[:, 1:]).all()
    assert np.isnan(s.displacement).all() and np.isnan(s.compliance).all()
    assert np.isfinite(s.stiffness).all()
    size = np.sqrt(np.diagonal(s.stiffness)[[0, 2, 3, 4]]).min()
    assert np.abs(s.stiffness @ free).max() < 1e-7 * size**2


@pytest.mark.parametrize("method", METHODS)
def test_several_free_twists(method: str) -> None:
    rng = np.random.default_rng(2)
    machine = b.serial(b.stiff("link", b.random_spd(rng)), ball("wrist"), home=Pose.of((0, 0, 0)))
    s = machine.solve((0, 0, 0), method=method)
    free = s.free_twists[:, :3]
    assert np.linalg.matrix_rank(free[3:]) == 3
    np.testing.assert_allclose(free[:3], 0, atol=1e-8)
    assert np.isnan(s.free_twists[:, 3:]).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_structure_without_springs_in_some_direction(method: str) -> None:
    """A stiffness that lacks rank frees the platform in its null directions."""
    k = np.diag([1e6, 2e6, 0.0, 1e4, 2e4, 3e4])
    s = b.serial(b.stiff("link", k)).solve((0, 0, 0), method=method)
    assert int(s.status) == sm.Status.SINGULAR
    np.testing.assert_allclose(np.abs(s.free_twists[:, 0]), [0, 0, 1, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(s.stiffness, k, atol=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_a_near_singular_pose_is_still_a_number(tripteron: sm.Machine, method: str) -> None:
    """Beside the stretched pose the answer goes to the stretched one, continuously."""
    load = np.array([0, 0, 100.0, 0, 0, 0])
    direction = np.array([0.6, 0.8, 0.0])
    there = tripteron.solve((0.9, 1.2, 0.5), load, method=method)
    off = []
    for gap in (1e-6, 1e-8, 1e-10):
        near = tripteron.solve(np.array([0.9, 1.2, 0.5]) - gap * direction, load, method=method)
        assert int(near.status) == sm.Status.CONVERGED
        off.append(np.abs(near.displacement - there.displacement).max())
    assert off[0] > 10 * off[1] > 100 * off[2]
    assert off[2] < 1e-4 * np.abs(there.displacement).max()

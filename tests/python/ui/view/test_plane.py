"""The map of the plane equals `Machine.solve`, pose by pose, colour by colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.solve.status import Status
from stiffmap.ui.plot.planes import levels
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.plane import DARK, GREY, QUANTITIES, colours_of, plane_image, table
from stiffmap.ui.view.state import ViewState
from stiffmap.workspace.performance.motion.velocity import singular_values

FORCE = (120.0, -80.0, -200.0)
OF_SOLUTION = [n for n, q in QUANTITIES.items() if q.of is not None]


@pytest.fixture(scope="module")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.mark.parametrize("quantity", OF_SOLUTION)
def test_values_are_those_of_solve(machine: sm.Machine, quantity: str) -> None:
    s = ViewState((0.05, 0.0, 0.1), force=FORCE, quantity=quantity, gravity=(0.0, 0.0, -9.81), tolerance=2e-4)
    found = Moment(machine, s).plane(7)
    p = found.frame.poses(7)
    for i, j in ((0, 0), (3, 5), (6, 2)):
        one = machine.solve(p[i, j], s.wrench, gravity=s.gravity)
        d = float(np.linalg.norm(one.displacement[:3]))
        top = np.linalg.svd(one.compliance[:3, :3], compute_uv=False)[0]
        want = {
            "deflection": d,
            "worst": float(np.linalg.norm(FORCE)) * top,
            "stiffness": 1 / top,
            "margin": 2e-4 - d,
            "status": 0.0,
        }[quantity]
        assert found.values[i, j] == pytest.approx(want, rel=1e-9)
        assert Moment(machine, s).at(p[i, j])[0] == pytest.approx(want, rel=1e-9)


def test_plane_lies_through_the_tool_and_across_the_box(machine: sm.Machine) -> None:
    low, high = machine.workspace
    for axis in "xyz":
        f = Moment(machine, ViewState((0.05, -0.1, 0.2), plane=axis)).frame()
        i = "xyz".index(axis)
        p = f.poses(3)
        assert np.ptp(p[..., i]) == 0 and p[0, 0, i] == (0.05, -0.1, 0.2)[i]
        others = [k for k in range(3) if k != i]
        np.testing.assert_allclose(p.min((0, 1))[others], low[others])
        np.testing.assert_allclose(p.max((0, 1))[others], high[others])


def test_free_plane_holds_the_tool_and_hides_what_is_outside(machine: sm.Machine) -> None:
    s = ViewState((0.05, -0.1, 0.2), plane="free", normal=(1.0, 1.0, 1.0))
    found = Moment(machine, s).plane(21)
    f = found.frame
    assert abs((f.centre - np.array(s.position)) @ f.normal) < 1e-12
    low, high = machine.workspace
    p = f.poses(21)
    outside = ((p < low - 1e-9) | (p > high + 1e-9)).any(-1)
    np.testing.assert_array_equal(found.outside, outside)
    assert outside.any() and not outside.all()
    image = plane_image(found, found.range)
    np.testing.assert_array_equal(image[..., 3] == 0, outside)


def test_colours_are_those_of_the_values(machine: sm.Machine) -> None:
    found = Moment(machine, ViewState((0.0, 0.0, 0.1), force=FORCE)).plane(9)
    low, high = found.range
    image = plane_image(found, (low, high))
    assert image.shape == (9, 9, 4)
    index = np.rint((found.shown - low) / (high - low) * 255).astype(int)
    np.testing.assert_array_equal(image[..., :3], table()[index])
    assert (image[np.unravel_index(found.shown.argmax(), (9, 9))][:3] == table()[255]).all()


def test_not_a_number_is_grey_and_beyond_the_scale_is_its_end() -> None:
    out = colours_of(np.array([np.nan, -5.0, 99.0]), 0.0, 1.0)
    np.testing.assert_array_equal(out, [GREY, table()[0], table()[255]])


def test_failed_poses_are_hatched() -> None:
    machine = sm.load_machine("tripteron")
    s = ViewState(tuple(machine.description.home.p))  # type: ignore[arg-type]
    found = Moment(machine, s).plane(21)
    assert found.failed.any() and not found.failed.all()
    image = plane_image(found, found.range)
    hatched = (image[..., :3] == DARK).all(-1)
    k = len(image) // 21
    poses = hatched.reshape(21, k, 21, k).any((1, 3))
    np.testing.assert_array_equal(poses, found.failed)
    assert found.status[found.failed].min() > Status.CONVERGED


def test_isolines_lie_at_their_values(machine: sm.Machine) -> None:
    found = Moment(machine, ViewState((0.0, 0.0, 0.1), force=FORCE)).plane(41)
    for level in levels(*found.range)[:3]:
        for a, _ in found.lines_at(level)[::40]:
            s = machine.solve(a, (*FORCE, 0, 0, 0))
            assert 1e6 * np.linalg.norm(s.displacement[:3]) == pytest.approx(level, rel=2e-3)
    middle = float(np.mean(found.range)) * 1e-6
    assert len(found.tolerance_lines(middle)) > 10
    assert len(found.tolerance_lines(1.0)) == 0
    assert len(replace(found, quantity="status").isolines(found.range)) == 0


def test_the_largest_singular_value_is_that_of_lapack() -> None:
    rng = np.random.default_rng(3)
    many = rng.normal(size=(200, 3, 3)) * 10.0 ** rng.uniform(-12, 3, (200, 1, 1))
    special = np.array([np.eye(3), np.zeros((3, 3)), np.diag([2.0, 2.0, 1.0]), np.diag([0.0, 0.0, 1e-9])])
    for c in (many, special):
        np.testing.assert_allclose(
            singular_values(c)[:, 0], np.linalg.svd(c, compute_uv=False)[:, 0], rtol=1e-9
        )
    assert np.isnan(singular_values(np.full((2, 3, 3), np.nan))).all()


def test_dynamic_stiffness_begins_at_the_static_one(machine: sm.Machine) -> None:
    p = np.array([0.1, 0.0, 0.05])
    s = ViewState(tuple(p), force=(0.0, 0.0, -1.0))  # type: ignore[arg-type]
    static = 1 / np.linalg.svd(machine.solve(p, s.wrench).compliance[:3, :3], compute_uv=False)[0]
    assert float(Moment(machine, s).dynamic_stiffness(p)[0]) == pytest.approx(static, rel=1e-9)
    turned = replace(s, moment=(3.0, -2.0, 1.0))  # under a moment the compliance is no longer symmetric
    k = machine.solve(p, turned.wrench).stiffness
    c = np.linalg.inv((k + k.T) / 2)[:3, :3]
    assert float(Moment(machine, turned).dynamic_stiffness(p)[0]) == pytest.approx(
        1 / np.linalg.norm(c, 2), rel=1e-6
    )
    first = float(sm.natural_frequencies(machine, p, s.wrench).frequency[0])
    value, status = Moment(machine, replace(s, quantity="frequency")).at(p)
    assert value == pytest.approx(first) and status == Status.CONVERGED


def test_dynamic_stiffness_is_the_sum_over_all_modes(machine: sm.Machine) -> None:
    """All modes of the Orthoglide's tool together are its static compliance; so they are at every frequency."""
    p = np.array([0.1, 0.0, 0.05])
    s = ViewState(tuple(p), force=(0.0, 0.0, -1.0))  # type: ignore[arg-type]
    w = sm.natural_frequencies(machine, p, s.wrench, modes=100)
    k = 2 * np.pi * w.frequency[np.isfinite(w.frequency)]
    x, h = w.coordinates, 1e-6
    ends = [[machine.compiled.frames(x + t * u)[0][-1] for t in (h, -h)] for u in w.shape[: len(k)]]
    motion = np.array([(a - b) / (2 * h) for a, b in ends])
    static = machine.solve(p, s.wrench).compliance[:3, :3]
    np.testing.assert_allclose(
        np.einsum("mi,mj,m->ij", motion, motion, k**-2), static, atol=1e-6 * np.abs(static).max()
    )
    for f in (5.0, 61.0, 100.0, 900.0):
        at = 2 * np.pi * f
        c = np.einsum("mi,mj,m->ij", motion, motion, 1 / (k**2 - at**2 + 2j * 0.02 * k * at))
        want = 1 / np.linalg.svd(c, compute_uv=False)[0]
        assert float(Moment(machine, replace(s, frequency=f)).dynamic_stiffness(p)[0]) == pytest.approx(
            want, rel=1e-4
        )


def test_quantities_of_modes_are_mapped_coarsely(machine: sm.Machine) -> None:
    found = Moment(machine, ViewState((0.0, 0.0, 0.0), quantity="frequency")).plane(3)
    assert found.count == 3 and (found.values > 1).all()


def test_a_ray_meets_the_plane(machine: sm.Machine) -> None:
    f = Moment(machine, ViewState((0.0, 0.0, 0.1))).frame()
    hit = f.under_ray(np.array([0.1, 0.2, 5.0]), np.array([0.0, 0.0, -1.0]))
    assert hit is not None
    np.testing.assert_allclose(hit, [0.1, 0.2, 0.1], atol=1e-12)
    assert f.under_ray(np.array([0.1, 0.2, 5.0]), np.array([0.0, 0.0, 1.0])) is None
    assert f.under_ray(np.array([9.0, 0.2, 5.0]), np.array([0.0, 0.0, -1.0])) is None
    assert f.under_ray(np.array([0.0, 0.2, 5.0]), np.array([1.0, 0.0, 0.0])) is None

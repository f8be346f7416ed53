"""Load paths past limit points and through buckling loads, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.solve import structures as s
from tests.python.solve.test_load_path import BUCKLES, LENGTH, SHIFT, column, leaning

import stiffmap as sm
from stiffmap.workspace.maps.files import read_dataset, write_dataset

DOWN = (0, -1, 0)
APEX = (0, s.RISE, 0)


def limit_height() -> float:
    """Height of the apex at the limit point: L^3 = L0 REACH^2 (dF/dh = 0)."""
    rest = np.hypot(s.REACH, s.RISE)
    return float(np.sqrt((rest * s.REACH**2) ** (2 / 3) - s.REACH**2))


@pytest.mark.parametrize("control", ["displacement", "arc"])
def test_two_bar_truss_snaps_through(control: str) -> None:
    path = sm.sweep(s.truss(), APEX, DOWN, control=control, limit=2.3 * s.RISE)
    assert path.attrs["end"] == "the limit was reached"
    drop = path.deflection_along.values
    assert drop[0] == pytest.approx(0, abs=1e-12) and drop[-1] >= 2.3 * s.RISE * (1 - 1e-9)
    np.testing.assert_allclose(path.force, s.truss_force(drop), rtol=1e-7, atol=1e-6)
    # up to the limit point stable, then not until the second one, then stable again
    heights = np.array([limit_height(), -limit_height()])
    np.testing.assert_array_equal(path.critical_kind, ["limit", "limit"])
    np.testing.assert_allclose(path.critical_deflection, s.RISE - heights, rtol=1e-7)
    np.testing.assert_allclose(path.critical_force, s.truss_force(s.RISE - heights), rtol=1e-9)
    between = (drop > s.RISE - heights[0]) & (drop < s.RISE - heights[1])
    np.testing.assert_array_equal(path.unstable_modes, between.astype(int))
    np.testing.assert_array_equal(path.status == sm.Status.UNSTABLE, between)


def test_load_control_stops_at_the_limit_point() -> None:
    top = float(s.truss_force(np.array(s.RISE - limit_height())))
    path = sm.sweep(s.truss(), APEX, DOWN, limit=1.5 * top)
    assert path.attrs["end"] == "no further equilibrium was found"
    assert 0.9 * top < path.force[-1] <= top * (1 + 1e-6)


def test_every_height_by_imposed_displacement() -> None:
    """The platform turns freely on its pin, so forces alone leave it open; held, it has a wrench."""
    machine, drop = s.truss(loose=True), np.linspace(0.02, 0.18, 9)
    assert machine.solve(APEX).status == sm.Status.SINGULAR
    held = machine.wrench(APEX, np.stack([0 * drop, -drop, *[0 * drop] * 4], -1))
    assert held.ok.all()
    np.testing.assert_allclose(-held.wrench[:, 1], s.truss_force(drop), rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(held.wrench[:, [0, 5]], 0, atol=1e-6)
    # nothing yields out of the plane: what holds the machine there is open
    assert np.isnan(held.wrench[:, [2, 3, 4]]).all()


@pytest.mark.parametrize("links", [1, 2, 5])
def test_euler_column(links: int) -> None:
    machine, top = s.column(links), s.column_load(links, 1)
    tip = (links * 0.2, 0, 0)
    highest = s.column_load(links, min(2, links))
    path = sm.sweep(machine, tip, (-1, 0, 0), limit=1.3 * highest)
    wanted = [s.column_load(links, k) for k in range(1, min(2, links) + 1)]
    np.testing.assert_allclose(path.critical_force, wanted, rtol=1e-9)
    assert (path.critical_kind == "bifurcation").all()
    np.testing.assert_array_equal(path.unstable_after, range(1, len(wanted) + 1))
    np.testing.assert_array_equal(path.unstable_modes[path.force < top], 0)
    np.testing.assert_allclose(path.deflection, 0, atol=1e-12)
    first = path.mode.values[0] / path.mode.values[0][0]
    angle = np.cumsum(first)  # absolute angles of the links: sin((2 i - 1) pi / (2 (2 n + 1))) ...
    i = np.arange(1, links + 1)
    shape = np.sin(i * np.pi / (2 * links + 1))
    np.testing.assert_allclose(angle / angle[0], shape / shape[0], rtol=1e-7)
    assert path.mode_leg.values[0] == machine.legs[0]
    assert path.mode_joint.values[0].startswith(f"{machine.legs[0]}.hinge_1")


def test_many_links_approach_euler() -> None:
    """n links of a cantilever of bending stiffness c l: pi^2 EI / (4 L^2) in the limit."""
    links, c, link = 40, 100.0, 0.02
    path = sm.sweep(s.column(links, c, link), (links * link, 0, 0), (-1, 0, 0), limit=400.0, steps=4)
    euler = np.pi**2 * c * link / (4 * (links * link) ** 2)
    assert float(path.critical_force[0]) == pytest.approx(euler, rel=0.03)


def test_an_arc_needs_a_motion_along_the_force() -> None:
    path = sm.sweep(s.column(2), (0.4, 0, 0), (-1, 0, 0), control="arc", limit=0.1)
    assert path.attrs["end"] == "no further equilibrium was found"
    assert path.sizes["step"] == 1


def test_a_real_machine_pushed_by_displacement() -> None:
    machine = sm.load_machine("orthoglide-revised")
    path = sm.sweep(machine, (0.1, 0.1, 0.1), (1, -1, 0), control="displacement", limit=5e-4, steps=5)
    same = sm.sweep(machine, (0.1, 0.1, 0.1), (1, -1, 0), path.force.values, method="reference")
    np.testing.assert_allclose(path.displacement, same.displacement, rtol=1e-6, atol=1e-10)
    assert path.sizes["critical"] == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"control": "speed", "limit": 1}, "control: expected one of force, displacement, arc"),
        ({"control": "arc"}, r"limit: expected a number other than 0 \(m"),
        ({}, r"limit: expected a number other than 0 \(N"),
        ({"limit": float("nan")}, "limit: expected"),
        ({"forces": [1.0], "limit": 2.0}, "limit: not together with forces"),
        ({"forces": [1.0], "control": "arc", "limit": 2.0}, "forces: not with control"),
        ({"limit": 1.0, "steps": 0}, "steps: expected a positive number"),
        ({"limit": 1.0, "load_type": "follower"}, "load_type: a path needs a conservative force"),
        ({"limit": 1.0, "point": "nose"}, "point: expected one of tcp"),
    ],
)
def test_bad_input(options: dict[str, object], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        sm.sweep(s.truss(), APEX, DOWN, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("ending", ["nc", "zarr"])
def test_a_path_is_the_same_from_the_disk(tmp_path: Path, ending: str) -> None:
    if ending == "zarr":
        pytest.importorskip("zarr")
    path = sm.sweep(s.column(2), (0.4, 0, 0), (-1, 0, 0), limit=1.2 * s.column_load(2, 2))
    assert path.sizes["critical"] == 2
    with read_dataset(write_dataset(path, tmp_path / f"path.{ending}")) as stored:
        assert stored.load().identical(path)


@pytest.mark.parametrize(
    ("control", "limit"), [("force", 1.3 * BUCKLES), ("arc", 0.35), ("displacement", 0.2)]
)
@pytest.mark.parametrize("steps", [6, 10, 40])
@pytest.mark.parametrize("lean", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_a_sharp_bend_is_not_stepped_over(lean: float, steps: int, control: str, limit: float) -> None:
    """A column that leans a little has no bifurcation: its path bends within a share of about lean^(2/3) of the load, and
    another one, which is unstable, goes straight on. A step by load, displacement or arc stays on the path that bends."""
    along = np.array([lean, 0, -1]) / np.hypot(lean, 1)
    path = sm.sweep(column(), (0, 0, LENGTH), along, control=control, limit=limit, steps=steps)
    assert path.attrs["end"] == "the limit was reached"
    assert (path.unstable_modes == 0).all()
    force, aside = path.force.values[1:], path.displacement.values[1:, 0]
    load = force / np.hypot(lean, 1)
    wanted = [LENGTH * np.sin(leaning(f, lean)) + lean * f / SHIFT for f in load]
    np.testing.assert_allclose(aside, wanted, rtol=1e-6, atol=1e-9)
    assert abs(aside[-1]) > 0.3

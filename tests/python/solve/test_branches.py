"""Branches that cross a load path at a bifurcation, against closed forms of post-buckling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.special import ellipk
from tests.python.solve import builders as b, structures as s

import stiffmap as sm
from stiffmap.model.description import ExternalSpring, Offset, Pose

PUSH = (-1, 0, 0)


def crossing(path: xr.Dataset) -> xr.Dataset:
    """The points of the crossing branch behind the bifurcation."""
    return path.isel(step=path.branch.values == 1).isel(step=slice(1, None))


@pytest.mark.parametrize("side", [1, -1])
def test_one_link_goes_on_at_an_angle(side: int) -> None:
    """P = c q / (l sin q), stable, to either side."""
    path = sm.sweep(s.column(1), (0.2, 0, 0), PUSH, limit=1000.0, cross=side)
    assert path.attrs["crossing_end"] == "the limit was reached"
    branch = crossing(path)
    q = branch.displacement.values[:, 5]
    assert np.all(side * path.mode.values[0, 0] * q > 0) and abs(q[-1]) > 1.5
    np.testing.assert_allclose(branch.force, 100.0 * q / (0.2 * np.sin(q)), rtol=1e-9)
    np.testing.assert_allclose(branch.deflection_along, 0.2 * (1 - np.cos(q)), atol=1e-12)
    assert (branch.unstable_modes == 0).all()
    # the straight column is still there, unstable, and listed as branch 0
    straight = path.isel(step=path.branch.values == 0)
    np.testing.assert_allclose(straight.deflection, 0, atol=1e-12)
    assert straight.unstable_modes.values[-1] == 1


@pytest.mark.parametrize("links", [2, 5, 20])
def test_buckled_columns_stand_in_equilibrium(links: int) -> None:
    """Hinge by hinge from the tip: c (q_i - q_(i-1)) = P l (sin q_i + ... + sin q_n), and q_0 = 0."""
    c, link = 100.0, 0.2
    path = sm.sweep(s.column(links), (links * link, 0, 0), PUSH, limit=2 * s.column_load(links), cross=1)
    assert path.attrs["crossing_end"] == "the limit was reached"
    for step in range(1, crossing(path).sizes["step"], 5):
        point = crossing(path).isel(step=step)
        moved, angle = point.displacement.values, [float(point.displacement[5])]
        for _ in range(links):
            torque = float(point.force) * link * np.sin(angle).sum()
            angle.append(angle[-1] - torque / c)
        assert angle[-1] == pytest.approx(0, abs=1e-8)
        tip = link * np.array([np.cos(angle[:-1]).sum() - links, np.sin(angle[:-1]).sum()])
        np.testing.assert_allclose(moved[:2], tip, atol=1e-8)


def test_many_links_approach_the_elastica() -> None:
    """Cantilever of bending stiffness EI: P = EI K(sin(a / 2))^2 / L^2 for an end angle a (Euler)."""
    errors = []
    for links in (20, 40):
        link, stiff = 1.0 / links, 1.0 * links
        machine = s.column(links, stiff, link)
        path = sm.sweep(machine, (1, 0, 0), PUSH, limit=1.5 * np.pi**2 / 4, cross=1, steps=20)
        branch = crossing(path)
        end = np.abs(branch.displacement.values[:, 5])
        elastica = ellipk(np.sin(end / 2) ** 2) ** 2
        assert end[-1] > 1.5
        errors.append(np.abs(branch.force.values / elastica - 1).max())
    assert errors[1] < 0.55 * errors[0] < 0.06


def strut(anchor: tuple[float, float], stiffness: float = 1e4, length: float = 0.5) -> sm.Machine:
    """An upright bar on a pin, held by a spring from its tip to an anchor; free of force when upright."""
    bar = b.serial(b.revolute("pin", "z"), b.shift("bar", (length, 0, 0)), home=Pose.of((length, 0, 0)))
    rest = float(np.hypot(length - anchor[0], anchor[1]))
    held = ExternalSpring("tie", "tcp", (*anchor, 0.0), stiffness, rest)
    return sm.Machine(replace(bar.description, external_springs=(held,)))


def strut_force(q: np.ndarray, anchor: tuple[float, float]) -> np.ndarray:
    """Force along -x from the energy k (s - s0)^2 / 2 - P L (1 - cos q)."""
    k, length = 1e4, 0.5
    tip = length * np.stack([np.cos(q), np.sin(q)], -1)
    way = tip - anchor
    size = np.linalg.norm(way, axis=-1)
    rest = np.hypot(length - anchor[0], anchor[1])
    turn = length * np.stack([-np.sin(q), np.cos(q)], -1)
    return np.asarray(k * (size - rest) * np.sum(way * turn, -1) / size / (length * np.sin(q)))


@pytest.mark.parametrize("side", [1, -1])
def test_the_load_of_an_inclined_tie_falls_on_one_side_only(side: int) -> None:
    """Transcritical: the branch crosses at an angle, stable where the load rises, unstable where it falls."""
    anchor = (0.0, -0.5)
    path = sm.sweep(strut(anchor), (0.5, 0, 0), PUSH, limit=4000.0, cross=side)
    assert float(path.critical_force[0]) == pytest.approx(1e4 * 0.5 / 2, rel=1e-9)  # k L sin^2 45 deg
    branch = crossing(path)
    q = branch.displacement.values[:, 5]
    np.testing.assert_allclose(branch.force, strut_force(q, anchor), rtol=1e-8)
    first, rises = branch.isel(step=0), float(branch.force[0]) > float(path.critical_force[0])
    assert int(first.unstable_modes) == (0 if rises else 1)
    slope = np.sign(strut_force(np.array([1e-3 * np.sign(q[0])]), anchor)[0] - 2500)
    assert rises == (slope > 0)


def test_a_horizontal_spring_makes_it_fall_on_both_sides() -> None:
    """Subcritical: P = k L cos q for a spring that stays level (anchor far away); unstable."""
    anchor = (0.5, -5000.0)
    path = sm.sweep(strut(anchor), (0.5, 0, 0), PUSH, limit=6000.0, cross=1)
    branch = crossing(path)
    q = branch.displacement.values[:, 5]
    np.testing.assert_allclose(branch.force, strut_force(q, anchor), rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(branch.force, 1e4 * 0.5 * np.cos(q), rtol=0, atol=0.6)
    assert (branch.unstable_modes.values[np.abs(q) < 1.0] == 1).all()
    assert path.attrs["crossing_end"] == "the force fell to zero"


def test_a_crooked_column_bends_towards_the_branch() -> None:
    """Built with an angle q0: c (q - q0) = P l sin q, without a bifurcation."""
    q0, machine = 1e-3, s.column(1)
    leg = machine.description.legs[0]
    pin = Offset("crooked", Pose(), Pose.of((0, 0, 0), b.rotation((0, 0, 1), q0)))
    bent = replace(machine.description, legs=(replace(leg, elements=(pin, *leg.elements)),))
    path = sm.sweep(sm.Machine(bent), (0.2, 0, 0), PUSH, control="arc", limit=0.1)
    q = path.displacement.values[:, 5]
    np.testing.assert_allclose(path.force, 100.0 * (q - q0) / (0.2 * np.sin(q)), rtol=1e-7, atol=1e-6)
    assert path.sizes["critical"] == 0 and (path.unstable_modes == 0).all()


def test_modes_that_buckle_together_are_said_so() -> None:
    """Six equal rods, each in two planes: one of them is named, and no branch is made up."""
    machine = sm.load_machine("linear-delta")
    home = machine.description.home.p
    path = sm.sweep(machine, home, (0, 0, -1), control="displacement", limit=20e-3, cross=1, steps=10)
    assert path.attrs["crossing_end"] == "not followed: 12 modes at once, no single branch"
    rod = str(path.mode_joint.values[0]).rsplit(".", 2)[0] + "."  # leg and branch
    size = np.abs(path.mode.values[0])
    of_rod = np.array([str(n).startswith(rod) for n in path.coordinate.values])
    assert size[of_rod].max() > 1 and size[~of_rod].max() < 1e-3
    assert str(path.mode_joint.values[0]).split(".")[0] == path.mode_leg.values[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limit": 1000.0, "cross": 2}, "cross: the path has 1 bifurcations, got 2"),
        ({"limit": 10.0, "cross": -1}, "cross: the path has 0 bifurcations, got -1"),
        ({"limit": 10.0, "cross": 1.5}, "cross: expected a whole number"),
        ({"forces": [1.0], "cross": 1}, "cross: not together with forces"),
    ],
)
def test_bad_input(options: dict[str, object], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        sm.sweep(s.column(1), (0.2, 0, 0), PUSH, **options)  # type: ignore[arg-type]

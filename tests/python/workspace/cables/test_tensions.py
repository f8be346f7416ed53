"""Structure matrices, distributions of tension and wrench-feasible boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from tests.python.workspace.cables.made import hanging

from stiffmap import Machine, StiffmapError, force_transmission, inverse_kinematics, load_machine
from stiffmap.model.description import Drive, ExternalSpring, Point
from stiffmap.workspace.cables import structure_matrix, tension_distribution, wrench_feasible
from stiffmap.workspace.cables.feasible import changed, turned
from stiffmap.workspace.cables.structure import hanging as hanging_of, lines, scaled

SIX = ("x", "y", "z", "rx", "ry", "rz")


def frame(radius: float = 0.0, force: float | None = None) -> Machine:
    corners = [(sx * 2.0, sy * 1.5, z) for z in (0.0, 2.0) for sx in (-1, 1) for sy in (-1, 1)]
    # Crossed: the upper cables hold the lower edge.
    at = [
        ((0.3 if z else 0.1) * np.sign(x), (0.1 if z else 0.3) * np.sign(y), -0.15 if z else 0.15)
        for x, y, z in corners
    ]
    return hanging(
        corners,
        at=[tuple(map(float, p)) for p in at],
        freedoms=SIX,
        home=(0.0, 0.0, 1.0),
        elasticity=1e5,
        radius=radius,
        mass=10.0,
        gravity=(0.0, 0.0, -9.81),
        drive=Drive(force=force) if force else None,
    )


@pytest.mark.parametrize("radius", [0.0, 0.05])
def test_structure_matrix_is_the_slope_of_the_lengths(radius: float) -> None:
    """Virtual work: translations by central differences of the winch lengths."""
    m, p, h = frame(radius), np.array([0.3, -0.2, 0.9]), 1e-5
    w = structure_matrix(m, p)
    for k in range(3):
        e = h * np.eye(3)[k]
        slope = (inverse_kinematics(m, p + e).actuators - inverse_kinematics(m, p - e).actuators) / (2 * h)
        np.testing.assert_allclose(-w[k], slope, atol=1e-8)


def test_distribution_balances_and_is_the_least() -> None:
    """Balance, limits, and the conditions of Karush, Kuhn and Tucker."""
    m = frame()
    rng = np.random.default_rng(1)
    p = np.array([0, 0, 1.0]) + rng.uniform(-0.4, 0.4, (20, 3))
    w = np.zeros((20, 6))
    w[:, :3] = rng.uniform(-100, 100, (20, 3))
    d = tension_distribution(m, p, w, lowest=20.0, highest=500.0)
    assert d.feasible.all()
    a = structure_matrix(m, p)
    load = w + np.array([0, 0, -98.1, 0, 0, 0])
    np.testing.assert_allclose(np.einsum("mrn,mn->mr", a, d.tension), -load, atol=1e-5)
    assert d.tension.min() >= 20.0 and d.tension.max() <= 500.0
    for i in range(20):
        free = (d.tension[i] > 20.0) & (d.tension[i] < 500.0)
        v = np.linalg.lstsq(a[i][:, free].T, d.tension[i, free] - 20.0, rcond=None)[0]
        z = a[i].T @ v
        np.testing.assert_allclose(z[free], d.tension[i, free] - 20.0, atol=1e-4)
        if np.linalg.matrix_rank(a[i][:, free]) == 6:
            assert (z[d.tension[i] <= 20.0] < 1e-4).all()


@pytest.mark.parametrize("point", ["platform.hook", "tcp"])
@pytest.mark.parametrize("tension_only", [False, True])
@pytest.mark.parametrize("length", [0.2, 1.5])
@pytest.mark.parametrize("anchor", [(0.0, 0.0, 3.0), (1.0, 0.5, 2.0)])
def test_springs_outside_pull_with_the_cables(
    anchor: tuple[float, float, float], length: float, tension_only: bool, point: str
) -> None:
    """Tensions and held forces are those of the same pull as a wrench, by hand; boxes refuse."""
    m, p, hook = (
        frame(force=2000.0),
        np.array([0.2, -0.1, 1.05]),
        np.array([0.05, 0.0, 0.2]) * (point != "tcp"),
    )
    spring = ExternalSpring("spine", point, anchor, 80.0, length, tension_only)
    d = m.description
    sprung = Machine(
        replace(d, platform=(*d.platform, Point("hook", tuple(hook))), external_springs=(spring,))
    )
    line = np.array(anchor) - p - hook
    stretch = np.linalg.norm(line) - length
    pull = 80.0 * (max(stretch, 0.0) if tension_only else stretch) * line / np.linalg.norm(line)
    wrench = np.hstack([pull, np.cross(hook, pull)])
    found = tension_distribution(sprung, p, lowest=50.0).tension
    np.testing.assert_allclose(found, tension_distribution(m, p, wrench, lowest=50.0).tension, atol=1e-6)
    none = force_transmission(sprung, p, gravity=[0, 0, 0])
    np.testing.assert_allclose(structure_matrix(m, p) @ -none.bias, -wrench, atol=1e-5)
    away = np.random.default_rng(0).normal(size=(500, 3))
    away *= none.force_min / np.linalg.norm(away, axis=1)[:, None]
    with_pull = np.hstack([away, 0 * away]) * np.array([0.999, 1.2])[:, None, None] + wrench
    feasible = tension_distribution(m, p, with_pull, gravity=[0, 0, 0]).feasible
    assert feasible[0].all() and not feasible[1].all()
    with pytest.raises(StiffmapError, match=r"external springs.*spine"):
        wrench_feasible(sprung, box=[p - 0.1, p + 0.1])


def test_infeasible_is_what_a_linear_program_says() -> None:
    """Feasible or not, against an independent solver, at loads about the limit."""
    m = frame(force=400.0)
    rng = np.random.default_rng(2)
    p = np.array([0, 0, 1.0]) + rng.uniform(-0.5, 0.5, (60, 3))
    w = np.zeros((60, 6))
    w[:, :3] = rng.normal(size=(60, 3)) * 350
    d = tension_distribution(m, p, w, lowest=10.0)
    a = structure_matrix(m, p)
    seen = []
    for i in range(60):
        b = -(w[i] + np.array([0, 0, -98.1, 0, 0, 0]))
        found = linprog(np.zeros(8), A_eq=a[i], b_eq=b, bounds=[(10.0, 400.0)] * 8)
        seen.append(found.status == 0)
    assert 5 < sum(seen) < 55
    assert (d.feasible == np.array(seen)).all()
    assert np.isnan(d.tension[~d.feasible]).all()


def test_the_last_newton_that_tensions_hold_is_found() -> None:
    """Along random directions up to the largest force of a linear program: a millionth less holds, a millionth more does
    not."""
    m = frame(force=400.0)
    rng = np.random.default_rng(5)
    p = np.array([0, 0, 1.0]) + rng.uniform(-0.4, 0.4, (12, 3))
    way = np.zeros((12, 6))
    way[:, :3] = rng.normal(size=(12, 3))
    weight = np.array([0, 0, -98.1, 0, 0, 0])
    most = np.empty(12)
    for i, a in enumerate(structure_matrix(m, p)):
        found = linprog(
            [*np.zeros(8), -1.0],
            A_eq=np.c_[a, way[i]],
            b_eq=-weight,
            bounds=[(10.0, 400.0)] * 8 + [(0, None)],
        )
        most[i] = found.x[-1]
    for share, holds in ((1 - 1e-6, True), (1 + 1e-6, False), (1 + 1e-4, False)):
        d = tension_distribution(m, p, share * most[:, None] * way, lowest=10.0)
        assert (d.feasible == holds).all(), share


def test_a_line_turns_by_no_more_than_its_bound() -> None:
    """Ends moved in all directions, and a bound that is hardly larger where the way is short."""
    rng = np.random.default_rng(6)
    moves = rng.normal(size=(4000, 3))
    moves /= np.linalg.norm(moves, axis=1, keepdims=True)
    for straight, reach in ((2.0, 0.5), (1.0, 0.05), (0.3, 0.29), (5.0, 1e-3)):
        end = np.array([straight, 0, 0]) + reach * moves
        most = np.linalg.norm(end / np.linalg.norm(end, axis=1, keepdims=True) - [1, 0, 0], axis=1).max()
        bound = float(turned(np.array(straight), np.array(reach)))
        assert most <= bound <= most * 1.01 * straight / (straight - reach)
    assert turned(np.array(1.0), np.array(1.0)) == np.inf


@pytest.mark.parametrize("reach", [0.02, 0.3])
def test_a_column_changes_by_no_more_than_its_bound_and_by_nearly_as_much(reach: float) -> None:
    """The structure matrix itself, at ends of many moves of a platform on cables without pulleys."""
    rng = np.random.default_rng(7)
    m, p = frame(), np.array([0.4, -0.3, 1.1])
    moves = rng.normal(size=(4000, 3))
    moves *= reach / np.linalg.norm(moves, axis=1, keepdims=True)
    h = hanging_of(m)
    _, straight, arm = lines(h, p, np.eye(3))
    here, there = (scaled(h, structure_matrix(m, q), np.zeros(6))[0] for q in (p, p + moves))
    most = np.linalg.norm(there - here, axis=1).max(axis=0)
    bound = changed(h, straight, arm, np.array(reach))
    assert (most <= bound).all()
    assert (bound <= 1.02 * most * (straight / (straight - reach)) ** 2).all()


def test_boxes_are_proven() -> None:
    """Nothing inside fails, nothing outside holds, and most is decided."""
    m = frame(force=400.0)
    wrenches = 60.0 * np.array([[1, 0, 0, 0, 0, 0], [-1, 0, 0, 0, 0, 0], [0, 0, -1, 0, 0, 0.0]])
    f = wrench_feasible(m, wrenches, box=[[-1.8, 0.0, 0.4], [1.8, 0.0, 1.9]], lowest=10.0, gap=0.01)
    inside, outside, open_ = f.share
    assert inside > 0.2 and outside > 0.05 and open_ < 0.45
    rng = np.random.default_rng(3)
    for cells, holds in ((f.inside, True), (f.outside, False)):
        some = cells[rng.integers(0, len(cells), 60)]
        p = some[:, 0] + rng.uniform(0, 1, (60, 3)) * (some[:, 1] - some[:, 0])
        ok = tension_distribution(m, p[:, None], wrenches, lowest=10.0).feasible.all(axis=1)
        assert (ok == holds).all()


def test_bad_input_is_named() -> None:
    """Limits that cross, machines with legs."""
    with pytest.raises(StiffmapError, match="lowest"):
        tension_distribution(frame(), (0, 0, 1.0), lowest=50.0, highest=20.0)
    with pytest.raises(StiffmapError, match="legs"):
        structure_matrix(load_machine("five-bar"), (0, 0.4, 0))

"""Stability is the inertia of the whole tangent (theory K4): closed forms, and the lowest eigenvalue of the
energy's Hessian over the motions that keep the loops closed."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Element, Joint, Law, Leg, MachineDescription, Pose

LENGTH, ROOT, GUIDE = 0.5, 1000.0, 1e8  # m, N·m/rad, N/m
BUCKLES = ROOT / LENGTH  # N, without the guide
METHODS = ["reference", "fast"]


def root(kind: str, stiff: float, turn: float = ROOT) -> tuple[Element, ...]:
    """Turns elastically about x and y: by a spring, or by joints between rigid springs."""
    if kind == "spring":
        return (b.stiff("root", np.diag([stiff, stiff, stiff, turn, turn, 1e6])),)
    law = Law(turn)
    ball = Joint("root", "universal", (b.AXES["x"], b.AXES["y"]), home=(0.0, 0.0), law=law)
    joints = (
        (ball,) if kind == "universal" else (b.revolute("rx", "x", law=law), b.revolute("ry", "y", law=law))
    )
    return (b.stiff("foot", np.diag([stiff] * 6)), *joints)


def strut(kind: str, guided: bool, guide_stiffness: float = GUIDE, turn: float = ROOT) -> sm.Machine:
    """Upright on its elastic root. A ball joint at its top carries the platform, which the guide holds
    upright; a guide without sideways stiffness only holds its direction."""
    sideways, stiff = (guide_stiffness, GUIDE) if guided else (1e-3, 1e7)
    column = (
        *root(kind, stiff, turn),
        b.shift("strut", (0, 0, LENGTH)),
        b.revolute("tx", "x"),
        b.revolute("ty", "y"),
    )
    guide = (
        b.shift("up", (0, 0, LENGTH)),
        b.stiff("guide", np.diag([sideways, sideways, *[stiff] * 4])),
        Joint("free", "prismatic", (b.AXES["z"],), home=(0.0,)),
    )
    return sm.Machine(
        MachineDescription("strut", (Leg("strut", column), Leg("guide", guide)), home=Pose.of((0, 0, LENGTH)))
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("share", [0.5, 0.97, 0.999])
def test_a_soft_direction_beside_very_stiff_ones_is_no_free_one(method: str, share: float) -> None:
    """Ten decades between the guide's stiffness along the strut and what is left across it."""
    guide = (
        b.shift("up", (0, 0, LENGTH)),
        b.stiff("guide", np.diag([1e3, 1e3, 1e12, 1e9, 1e9, 1e9])),
        Joint("free", "prismatic", (b.AXES["z"],), home=(0.0,)),
    )
    column = strut("universal", True).description.legs[0]
    d = MachineDescription("strut", (column, Leg("guide", guide)), home=Pose.of((0, 0, LENGTH)))
    left = (1 - share) * (ROOT / LENGTH**2 + 1e3)  # N/m
    thrust = share * (ROOT / LENGTH + 1e3 * LENGTH)
    s = sm.Machine(d).solve((0, 0, LENGTH), (0, 0, -thrust, 0, 0, 0), method=method)
    assert s.status == sm.Status.CONVERGED
    # the foot gives way by the thrust, so that the strut leans a little more easily
    np.testing.assert_allclose(np.diag(s.compliance)[:2], 1 / left, rtol=1e-2 if share < 0.99 else 0.1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["spring", "universal", "revolutes"])
@pytest.mark.parametrize("share", [0.5, 0.999, 1.0, 1.001, 1.7, 2.0, 20.0, 100.0])
def test_a_guided_strut_does_not_buckle(kind: str, method: str, share: float) -> None:
    s = strut(kind, True).solve((0, 0, LENGTH), (0, 0, -share * BUCKLES, 0, 0, 0), method=method)
    assert s.status == sm.Status.CONVERGED and not s.flags & sm.Flag.RIGID_DIRECTION
    # guide and strut side by side: the strut's share falls with the force and goes on below zero
    want = GUIDE + (ROOT / LENGTH - share * BUCKLES) / LENGTH
    np.testing.assert_allclose(np.diag(s.stiffness)[:2], want, rtol=1e-4)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["spring", "universal", "revolutes"])
@pytest.mark.parametrize(
    ("guide", "turn"),  # the guide holds what the root does not
    [
        (guide, turn)
        for guide in (1e5, 1e8, 1e11)
        for turn in (0.1, 10.0, 1e3, 1e5)
        if guide * LENGTH**2 >= 100 * turn
    ],
)
def test_next_to_the_pole_nothing_is_rigid(guide: float, turn: float, kind: str, method: str) -> None:
    """Stiffness contrasts up to 1e12, loads within 1e-9 of the one at which the strut alone is indifferent."""
    machine = strut(kind, True, guide, turn)
    for share in (1 - 1e-3, 1 - 1e-6, 1 - 1e-9, 1.0, 1 + 1e-9, 1 + 1e-6, 1 + 1e-3, 3.0):
        force = share * turn / LENGTH
        s = machine.solve((0, 0, LENGTH), (0.01 * force, 0, -force, 0, 0, 0), method=method)
        assert s.status == sm.Status.CONVERGED and not s.flags & sm.Flag.RIGID_DIRECTION, share
        np.testing.assert_allclose(np.diag(s.stiffness)[:2], guide, rtol=0.03)
        np.testing.assert_allclose(s.stiffness @ s.compliance, np.eye(6), atol=1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["spring", "universal", "revolutes"])
def test_without_the_guide_it_buckles_at_k_over_L(kind: str, method: str) -> None:
    machine = strut(kind, False)
    for share, status in ((0.5, "CONVERGED"), (0.99, "CONVERGED"), (1.01, "UNSTABLE"), (1.5, "UNSTABLE")):
        s = machine.solve((0, 0, LENGTH), (0, 0, -share * BUCKLES, 0, 0, 0), method=method)
        assert sm.Status(int(s.status)).name == status, share


@pytest.mark.parametrize("guided", [True, False])
@pytest.mark.parametrize("kind", ["spring", "universal"])
def test_sweep_and_solve_agree(kind: str, guided: bool) -> None:
    machine = strut(kind, guided)
    path = sm.sweep(machine, (0, 0, LENGTH), (0, 0, -1), limit=2.55 * BUCKLES, steps=25)
    force = path.force.values
    wrench = np.column_stack([np.zeros((len(force), 2)), -force, np.zeros((len(force), 3))])
    s = machine.solve((0, 0, LENGTH), wrench)
    np.testing.assert_array_equal(s.status, path.status)
    assert (path.unstable_modes.values > 0).any() != guided

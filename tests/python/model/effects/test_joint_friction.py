"""Dry friction of passive joints: the same as torques put on both bodies by hand, or as no joint at all."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Element, Joint, MachineDescription, Offset, Point, Pose

METHODS = ("fast", "reference")
FORCE = np.array([40.0, -25.0, 5.0, 0.0, 0.0, 0.0])
SIDES = ("left", "right")


def edited(change: Any) -> MachineDescription:
    """The five-bar with each element of a leg replaced by what `change(leg, element)` gives."""
    d = sm.load_machine("five-bar").description
    legs = tuple(
        replace(leg, elements=tuple(n for e in leg.elements for n in change(leg.name, e))) for leg in d.legs
    )
    return replace(d, legs=legs)


def with_points(leg: str, e: Element) -> tuple[Element, ...]:
    """A point on each of the bodies that an elbow joins."""
    return (Point("before"), e, Point("after")) if e.name == "elbow" else (e,)


def rigid(*held: str) -> Any:
    """No elbow in these legs: the home angle is built in."""

    def change(leg: str, e: Element) -> tuple[Element, ...]:
        if e.name != "elbow" or leg not in held:
            return with_points(leg, e)
        assert isinstance(e, Joint)
        c, s = np.cos(e.home[0]), np.sin(e.home[0])
        return (Offset("elbow", Pose.of([0, 0, 0], [[c, -s, 0], [s, c, 0], [0, 0, 1]])),)

    return change


def home(machine: sm.Machine) -> Any:
    return machine.description.home.p


def motion(machine: sm.Machine, force: np.ndarray) -> dict[str, float]:
    """How far each elbow turns under the load, rad."""
    loaded, still = (machine.solve(home(machine), w) for w in (force, 0 * force))
    return {
        side: float(loaded.joint_coordinates[f"{side}.elbow"] - still.joint_coordinates[f"{side}.elbow"])
        for side in SIDES
    }


def by_hand(machine: sm.Machine, torque: dict[str, float]) -> np.ndarray:
    """Displacement with a torque about z on the outer body of each elbow and its reaction on the inner one."""
    wrenches = {}
    for side, m in torque.items():
        wrenches[f"{side}.after"] = np.array([0, 0, 0, 0, 0, m])
        wrenches[f"{side}.before"] = np.array([0, 0, 0, 0, 0, -m])
    return machine.solve(home(machine), FORCE, wrenches=wrenches).displacement


@pytest.fixture(scope="module")
def plain() -> sm.Machine:
    return sm.Machine(edited(with_points))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("branch", "sign"), [("loading", -1.0), ("unloading", 1.0)])
def test_sliding_is_a_torque_against_the_motion(
    plain: sm.Machine, branch: str, sign: float, method: str
) -> None:
    rubbing = plain.with_effect("joint_friction", element="elbow", torque=0.02, branch=branch)
    got = rubbing.solve(home(plain), FORCE, method=method).displacement
    turned = motion(plain, FORCE)
    expected = by_hand(plain, {side: sign * 0.02 * np.sign(q) for side, q in turned.items()})
    np.testing.assert_allclose(got, expected, rtol=1e-7, atol=1e-13)
    assert np.abs(got - plain.solve(home(plain), FORCE).displacement).max() > 1e-8


@pytest.mark.parametrize("method", METHODS)
def test_below_the_level_a_joint_is_not_there(plain: sm.Machine, method: str) -> None:
    stuck = plain.with_effect("joint_friction", element="elbow", torque=1e4).solve(
        home(plain), FORCE, method=method
    )
    solid = sm.Machine(edited(rigid(*SIDES))).solve(home(plain), FORCE, method=method)
    np.testing.assert_allclose(stuck.displacement, solid.displacement, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(stuck.stiffness, solid.stiffness, rtol=1e-7, atol=1e-3)
    moved = stuck.joint_coordinates["left.elbow"] - plain.solve(home(plain)).joint_coordinates["left.elbow"]
    assert abs(moved) < 1e-14


@pytest.mark.parametrize("method", METHODS)
def test_one_sticks_while_the_other_slips(plain: sm.Machine, method: str) -> None:
    """Left held by a high level, right slipping at a low one."""
    mixed = plain.with_effect("joint_friction", element="elbow", legs=["left"], torque=1e4)
    mixed = mixed.with_effect("joint_friction", element="elbow", legs=["right"], torque=0.005)
    held = sm.Machine(edited(rigid("left")))
    loaded, still = (held.solve(home(plain), w) for w in (FORCE, 0 * FORCE))
    q = float(loaded.joint_coordinates["right.elbow"] - still.joint_coordinates["right.elbow"])
    got = mixed.solve(home(plain), FORCE, method=method).displacement
    np.testing.assert_allclose(got, by_hand(held, {"right": -0.005 * np.sign(q)}), rtol=1e-7, atol=1e-13)


def test_the_level_is_reached_between_sticking_and_slipping(plain: sm.Machine) -> None:
    """A stuck joint lets go where the torque that holds the solid machine's joint reaches the level."""
    machine = plain.with_effect("joint_friction", element="elbow", legs=["right"], torque=2.0)
    free = motion(plain, FORCE)["right"]
    turned = [
        float(machine.solve(home(plain), s * FORCE).joint_coordinates["right.elbow"])
        for s in np.linspace(0, 1, 41)
    ]
    start = float(plain.solve(home(plain)).joint_coordinates["right.elbow"])
    moved = (np.array(turned) - start) * np.sign(free)
    slips = moved > 1e-13
    assert np.abs(moved[~slips]).max() < 1e-13 and 1 < (~slips).sum() < 40
    assert (np.diff(slips.astype(int)) >= 0).all()  # once it slips, more load does not stop it
    slope = np.diff(moved[slips])[1:]
    np.testing.assert_allclose(slope, slope[0], rtol=1e-3)  # with the slope of the free joint
    np.testing.assert_allclose(slope[0], abs(free) / 40, rtol=2e-2)


def test_both_paths_and_every_branch_in_space() -> None:
    """All joints of the Orthoglide at once."""
    machine = sm.load_machine("orthoglide-revised")
    poses = np.array([[0.05, 0.1, -0.1], [0.2, -0.15, 0.25]])
    for branch in ("loading_stuck", "loading", "unloading"):
        rubbing = machine
        for joint in ("proximal", "distal", "pin_proximal", "pin_distal"):
            rubbing = rubbing.with_effect("joint_friction", element=joint, torque=0.3, branch=branch)
        a, b = (rubbing.solve(poses, [100.0, -50, 300, 0, 0, 0], method=m) for m in METHODS)
        assert (a.status == 0).all() and (b.status == 0).all()
        np.testing.assert_allclose(a.displacement, b.displacement, rtol=1e-8, atol=1e-14)
        np.testing.assert_allclose(a.stiffness, b.stiffness, rtol=1e-7, atol=1e-2)


def test_without_load_friction_does_nothing(plain: sm.Machine) -> None:
    for branch in ("loading_stuck", "loading", "unloading"):
        still = plain.with_effect("joint_friction", element="elbow", torque=0.5, branch=branch)
        assert np.abs(still.solve(home(plain)).displacement).max() < 1e-14


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"element": "motor", "torque": 1.0}, "there are: elbow, pin"),
        ({"element": "elbow", "force": 1.0}, "give torque"),
        ({"element": "elbow", "torque": -1.0}, "expected 0 to 100000 N·m"),
        ({"element": "elbow", "torque": 1.0, "branch": "up"}, "expected one of loading_stuck, loading"),
    ],
)
def test_bad_input(plain: sm.Machine, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        plain.with_effect("joint_friction", **arguments)

"""The oracle in bodies against closed forms, two independent programs' answers, and its own differences."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.oracle.cartesian.solve import Answer, Machine
from tests.oracle.cartesian.system import System
from tests.oracle.classes import CLASSES, Classes
from tests.oracle.energy import Loads

from stiffmap.model.description import (
    Body,
    Element,
    ExternalSpring,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)
from stiffmap.model.files import load_description

DATA = File(__file__).parents[2] / "data/reference"
NONE = np.zeros(3)
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def force(*f: float, gravity: Any = NONE, moment: Any = NONE) -> Loads:
    return Loads(np.array(f), np.array(moment), np.array(gravity), {})


def chain(*elements: Element, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> MachineDescription:
    return MachineDescription("chain", (Leg("only", elements),), home=Pose.of(at))


def stiffness(*k: float) -> Spring:
    return Spring("spring", stiffness=tuple(map(tuple, np.diag(k).tolist())))


def solved(d: MachineDescription, loads: Loads, **given: Any) -> Answer:
    a = Machine(d).solve(loads, **given)
    assert a.found
    return a


def test_a_cubic_drive() -> None:
    k, c, f = 1e6, 1e13, 400.0
    d = chain(Joint("drive", "prismatic", (X,), (0.3,), actuated=True, law=Law(k, c)), at=(0.3, 0.0, 0.0))
    a = solved(d, force(f, 0.0, 0.0))
    moved = a.displacement[0]
    assert k * moved + c * moved**3 == pytest.approx(f, rel=1e-12)
    assert a.compliance[0, 0] == pytest.approx(1 / (k + 3 * c * moved**2), rel=1e-10)
    assert a.effort["only.drive"] == pytest.approx(-f, rel=1e-12)
    assert a.leg_wrench["only"] == pytest.approx([-f, 0, 0, 0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("kind", ["dead", "follower"])
def test_a_hinge_under_a_force_that_keeps_its_way_and_one_that_turns(kind: str) -> None:
    k, length, f = 40.0, 0.5, 60.0
    d = chain(
        Joint("hinge", "revolute", (Z,), (0.0,), law=Law(k)),
        Offset("arm", Pose.of((length, 0, 0))),
        at=(length, 0.0, 0.0),
    )
    a = solved(d, force(0.0, f, 0.0), kind=kind)
    turn = a.displacement[5]
    assert k * turn == pytest.approx(f * length * (np.cos(turn) if kind == "dead" else 1.0), rel=1e-12)
    expected = 1 / (k + f * length * np.sin(turn)) if kind == "dead" else 1 / k
    assert a.compliance[5, 5] == pytest.approx(expected, rel=1e-10)


def test_the_order_of_a_springs_turns() -> None:
    k = (1e4, 2e4, 3e4, 50.0, 70.0, 90.0)
    d = chain(stiffness(*k))
    target = np.array([0.3, -0.4, 0.5])
    turn = Rotation.from_euler("XYZ", target).as_matrix()
    # the moment that holds it: each axis of the sequence bears its own spring
    first = Rotation.from_euler("X", target[0]).as_matrix()
    second = first @ Rotation.from_euler("Y", target[1]).as_matrix()
    axes = np.column_stack([[1, 0, 0], first[:, 1], second[:, 2]])
    moment = np.linalg.solve(axes.T, np.array(k[3:]) * target)
    a = solved(d, force(10.0, -20.0, 60.0, moment=moment))
    assert a.displacement[:3] == pytest.approx(np.array([10, -20, 60]) / k[:3], rel=1e-12)
    assert Rotation.from_rotvec(a.displacement[3:]).as_matrix() == pytest.approx(turn, abs=1e-12)
    skew = np.linalg.inv(a.compliance)[3:, 3:]
    x, y, z = moment
    assert skew - skew.T == pytest.approx(-np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), abs=1e-8)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_strut_buckles_at_its_root_stiffness_over_its_length(share: float) -> None:
    k, length = 300.0, 0.7
    root = Joint("root", "universal", (X, Y), (0.0, 0.0), law=Law(k))
    d = chain(root, Offset("strut", Pose.of((0, 0, length))), at=(0.0, 0.0, length))
    a = solved(d, force(0.0, 0.0, -share * k / length))
    assert a.stable == (share < 1) and a.crossed == (share > 1)


def test_frequencies_of_a_mass_on_springs_and_of_a_pendulum() -> None:
    mass, k = 3.0, np.array([1e4, 2e4, 4e4])
    inertia = ((0.2, 0, 0), (0, 0.3, 0), (0, 0, 0.4))
    d = replace(
        chain(stiffness(*k, 100.0, 200.0, 300.0)), platform=(Body("mass", mass, (0.0, 0.0, 0.0), inertia),)
    )
    wanted = np.sort(np.sqrt(np.r_[k / mass, np.array([100, 200, 300]) / [0.2, 0.3, 0.4]]) / (2 * np.pi))
    assert solved(d, force(0, 0, 0), modes=6).frequencies == pytest.approx(wanted, rel=1e-9)
    length, k0 = 0.8, 5.0
    hinge = Joint("hinge", "revolute", (Y,), (0.0,), law=Law(k0))
    d = replace(
        chain(hinge, Offset("arm", Pose.of((0, 0, -length))), at=(0.0, 0.0, -length)),
        platform=(Body("bob", mass),),
    )
    a = solved(d, force(0, 0, 0, gravity=(0, 0, -9.81)), modes=1)
    wanted = np.sqrt((k0 + mass * 9.81 * length) / (mass * length**2)) / (2 * np.pi)
    assert a.frequencies[0] == pytest.approx(wanted, rel=1e-9)


def test_a_pretensioned_pair_of_springs_holds_sideways_by_its_tension() -> None:
    k, length, rest = 5e4, 1.2, 1.19
    ropes = tuple(
        ExternalSpring(n, "platform.eye", (s * length, 0.0, 0.0), k, rest, True)
        for n, s in (("a", 1), ("b", -1))
    )
    base = chain(stiffness(1e-3, 1e-3, 1e-3, 1e3, 1e3, 1e3))
    d = replace(base, platform=(Point("eye"),), external_springs=ropes)
    a = solved(d, force(0, 0, 0))
    tension = k * (length - rest)
    assert 1 / a.compliance[0, 0] == pytest.approx(2 * k, rel=1e-6)
    assert 1 / a.compliance[1, 1] == pytest.approx(2 * tension / length, rel=1e-5)


@pytest.mark.parametrize("number", [0, 4, 8])
def test_orthoglide_of_an_independent_program(number: int) -> None:
    data = json.loads((DATA / "orthoglide_revised.json").read_text())
    case = data["cases"][number]
    length, unit = np.array([1e-3] * 3 + [1.0] * 3), np.array([1.0] * 3 + [1e-3] * 3)
    w = np.array(case["wrench_N"]) * unit
    a = solved(
        load_description("orthoglide-revised"),
        force(*w[:3], moment=w[3:]),
        pose=Pose.of(np.array(case["pose_mm"]) * 1e-3),
    )
    agree(
        a,
        np.array(case["displacement"]) * length,
        np.array(case["loaded_compliance"]) * length[:, None] / unit,
    )


def agree(a: Answer, displacement: np.ndarray, compliance: np.ndarray) -> None:
    assert a.stable
    assert a.displacement[:3] == pytest.approx(displacement[:3], abs=1e-11 * np.abs(displacement[:3]).max())
    assert a.displacement[3:] == pytest.approx(displacement[3:], abs=1e-12)
    scale = np.sqrt(np.diag(compliance))
    assert a.compliance / np.outer(scale, scale) == pytest.approx(
        compliance / np.outer(scale, scale), abs=1e-9
    )


EIGHT = json.loads((DATA / "cable_eight/reference.json").read_text())["cases"]


@pytest.mark.parametrize("case", EIGHT[::5], ids=lambda c: c["name"])
def test_cables_of_an_independent_program(case: dict[str, Any]) -> None:
    d = load_description(DATA / "cable_eight/machine.yaml")
    w = np.array(case["wrench"])
    gravity = case["gravity"] if case["gravity"] is not None else d.gravity
    a = solved(
        d, force(*w[:3], moment=w[3:], gravity=gravity), pose=Pose.of(case["position"], case["rotation"])
    )
    agree(a, np.array(case["displacement"]), np.array(case["compliance"]))
    for n, v in case["actuator_effort"].items():
        assert a.effort[n] == pytest.approx(v, abs=1e-8)
    for n, w in case["leg_wrench"].items():
        assert a.leg_wrench[n] == pytest.approx(w, abs=1e-8)


@pytest.mark.parametrize("name", [n for n in CLASSES if n != "few"])
def test_slopes_and_curvature_are_those_of_differences(name: str) -> None:
    """Gradients of what is measured, and the tangent, against central differences; fourth digit by digit as the step."""
    task = Classes(5).task(name)
    m = Machine(task.description)
    path = m.path(m.commanded(task.pose, task.drives), task.loads, task.kind)
    rng = np.random.default_rng(1)
    s: System = path.system
    multipliers = rng.normal(size=s.closures) * 100
    here = path.start.moved(rng.normal(size=6 * s.s.size) * 1e-3)
    t = s.at_state(here, multipliers, path.near, 1.0)
    way = rng.normal(size=6 * s.s.size)
    h = 1e-6
    ends = [s.at_state(here.moved(sign * h * way), multipliers, path.near, 1.0) for sign in (1, -1)]
    # the gradient is in the motions of each state: carried back to those of `here` by half a turn
    back = [transported(e.slope + e.load, -sign * h * way) for e, sign in zip(ends, (1, -1), strict=True)]
    numeric = (back[0] - back[1]) / (2 * h)
    assert numeric == pytest.approx(t.curve @ way, rel=1e-5, abs=1e-6 * np.abs(t.curve @ way).max())
    assert (ends[0].gap - ends[1].gap) / (2 * h) == pytest.approx(t.rows @ way, abs=1e-7 * np.abs(way).max())


def transported(gradient: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Moments m about turns at exp(w): those about turns added to w are (1 + S(w)/2)^T m, to first order."""
    out = gradient.reshape(-1, 6).copy()
    w = -motion.reshape(-1, 6)[:, 3:]
    out[:, 3:] -= np.cross(w, out[:, 3:]) / 2
    return np.asarray(out.ravel())

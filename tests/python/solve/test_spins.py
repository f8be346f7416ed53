"""A rod on two ball joints whose centre of mass is off its axis hangs like a pendulum (theory C10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from tests.python.solve import builders as b

import stiffmap as sm
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
from stiffmap.model.description.tree import edit_sequences

SPAN, MASS, OFF, G = 0.4, 2.0, 0.05, 9.81
GRAVITY = (0.0, 0.0, -G)
TIP = (0.0, 0.0, 0.2)
BALL = (b.AXES["x"], b.AXES["y"], b.AXES["z"])


def machine(angle: float, first: str = "xyz", rod: np.ndarray | None = None) -> sm.Machine:
    """A platform on a spring at the end of a rod along `rod` (x without), the rod's centre of mass turned by
    `angle` about it; `first`: the sequence of axes of the ball at the base."""
    r = np.eye(3) if rod is None else rod
    end = r @ (SPAN, 0, 0)
    axes = tuple(b.AXES[a] for a in first)
    swing = (
        Offset("turn", Pose.of((0, 0, 0), r)),
        Joint("low", "spherical", axes, home=(0.0, 0.0, 0.0)),
        Body("rod", MASS, (SPAN / 2, OFF * np.cos(angle), OFF * np.sin(angle))),
        b.shift("length", (SPAN, 0, 0)),
        b.stiff("yield", np.diag([1e6, 1e6, 1e6, 1e4, 1e4, 1e4])),
        Joint("high", "spherical", BALL, home=(0.0, 0.0, 0.0)),
        Offset("back", Pose.of((0, 0, 0), r.T)),
    )
    hold = (b.shift("to", end), b.stiff("hold", np.diag([1e6, 1e6, 1e6, 1e4, 1e4, 1e4])))
    legs = (Leg("hold", hold), Leg("swing", swing))
    return sm.Machine(MachineDescription("rod", legs, home=Pose.of(end)))


@pytest.mark.parametrize("method", ["reference", "fast"])
@pytest.mark.parametrize("angle", [-2.5, -1.0, 0.0, 0.7, 1.57, 3.0])
def test_the_centre_of_mass_hangs_below_a_level_rod(angle: float, method: str) -> None:
    s = machine(angle).solve((SPAN, 0, 0), gravity=GRAVITY, method=method)
    assert s.status == sm.Status.CONVERGED
    # half of the weight at either end, nothing across, no moment about the rod
    assert s.displacement[2] == pytest.approx(-MASS * G / 2 / 1e6, rel=1e-3)
    assert abs(s.displacement[1]) < 1e-3 * abs(s.displacement[2])
    assert abs(s.displacement[3]) * 1e4 < 1e-6 * MASS * G * OFF


@pytest.mark.parametrize("seed", range(4))
def test_the_answer_does_not_depend_on_the_turn_that_was_declared(seed: int) -> None:
    rng = np.random.default_rng(seed)
    r = Rotation.random(random_state=rng).as_matrix()
    at, force = r @ (SPAN, 0, 0), [*rng.normal(size=3) * 50, 0, 0, 0]
    answers = [
        machine(a, first, r).solve(at, force, gravity=GRAVITY)
        for a, first in ((0, "xyz"), (2.1, "yzx"), (-1.3, "zyx"))
    ]
    for s in answers[1:]:
        assert s.status == answers[0].status == sm.Status.CONVERGED
        scale = np.abs(answers[0].displacement).max()
        np.testing.assert_allclose(s.displacement, answers[0].displacement, atol=1e-9 * scale)
        scale = np.sqrt(np.outer(*[np.diag(answers[0].compliance)] * 2))
        np.testing.assert_allclose(s.compliance / scale, answers[0].compliance / scale, atol=1e-8)


def test_compliance_is_the_derivative_with_the_rod_free_to_turn() -> None:
    r = Rotation.from_rotvec((0.3, -0.5, 0.2)).as_matrix()
    m, at, base = machine(0.4, "xyz", r), r @ (SPAN, 0, 0), np.array([30.0, -20, 40, 0, 0, 0])
    s = m.solve(at, base, gravity=GRAVITY)
    for i in range(3):
        step = np.eye(6)[i] * 0.5
        both = m.solve(at, np.stack([base + step, base - step]), gravity=GRAVITY).displacement
        np.testing.assert_allclose((both[0] - both[1]) / 1.0, s.compliance[:, i], rtol=1e-5, atol=1e-12)


def test_a_centred_rod_stays_indifferent() -> None:
    m = sm.load_machine("linear-delta")
    s = m.solve((0, 0, 0.3), gravity=GRAVITY)
    assert s.status == sm.Status.CONVERGED and s.flags & sm.Flag.FREE_SPIN


def slanted(axes: np.ndarray, sprung: float = 0.0, angle: float = 0.4) -> sm.Machine:
    """The rod of `machine(angle)`, the coordinates of both its ball joints about other axes (rows): none of them is
    along the rod. `sprung`: N·m/rad about each axis of the lower ball."""
    d = machine(angle).description

    def change(e: object) -> object:
        if not isinstance(e, Joint):
            return e
        law = Law(sprung) if sprung and e.name == "low" else None
        return replace(e, axes=tuple(tuple(float(v) for v in a) for a in axes), law=law)

    legs = tuple(replace(leg, elements=tuple(change(e) for e in leg.elements)) for leg in d.legs)
    return sm.Machine(replace(d, legs=legs))


@pytest.mark.parametrize("seed", range(3))
def test_a_spin_is_found_about_a_line_that_is_no_axis(seed: int) -> None:
    axes = Rotation.random(random_state=seed).as_matrix()
    force = [20.0, -30, 40, 0, 0, 0]
    expected = machine(0.4).solve((SPAN, 0, 0), force, gravity=GRAVITY)
    s = slanted(axes).solve((SPAN, 0, 0), force, gravity=GRAVITY)
    assert s.status == sm.Status.CONVERGED and s.flags == expected.flags
    np.testing.assert_allclose(s.displacement, expected.displacement, atol=1e-12)
    scale = np.sqrt(np.outer(*[np.diag(expected.compliance)] * 2))
    np.testing.assert_allclose(s.compliance / scale, expected.compliance / scale, atol=1e-8)
    weightless = slanted(axes).solve((SPAN, 0, 0), force)
    assert weightless.status == sm.Status.CONVERGED and weightless.flags & sm.Flag.FREE_SPIN


@pytest.mark.parametrize("seed", range(3))
def test_a_rod_turns_half_round_in_any_axes(seed: int) -> None:
    """From the top, past what would be the locks of the declared axes; the spin is a coordinate of its own."""
    axes = Rotation.random(random_state=seed).as_matrix()
    force = [20.0, -30, 40, 0, 0, 0]
    expected = machine(0.4).solve((SPAN, 0, 0), force, gravity=GRAVITY)
    for angle in np.arange(-3, 3.1, 0.75):
        m = slanted(axes, angle=angle)
        s = m.solve((SPAN, 0, 0), force, gravity=GRAVITY)
        assert s.status == sm.Status.CONVERGED and not s.flags & sm.Flag.GIMBAL_LOCK
        np.testing.assert_allclose(s.displacement, expected.displacement, atol=1e-12)
        assert len(m.free_spins) == 1
        names = [n for n in s.coordinate_names if n.startswith(("swing.low", "swing.high"))]
        moved = {n: abs(x) for n, x in zip(s.coordinate_names, s.coordinates, strict=True) if n in names}
        turned = {n for n, x in moved.items() if x > 1e-2}
        assert turned <= {"swing.low.3", "swing.high.1"}


def test_a_force_on_the_rod_turns_it() -> None:
    """No weight: the point to which a force is tied comes to lie behind it, seen along the rod."""
    d = slanted(Rotation.random(random_state=4).as_matrix()).description

    def pulled(e: object) -> tuple[Element, ...]:
        return (Point("hook", (SPAN / 2, 0.0, OFF)), e) if isinstance(e, Body) else (e,)  # type: ignore[return-value]

    legs = tuple(
        replace(leg, elements=tuple(new for e in leg.elements for new in pulled(e))) for leg in d.legs
    )
    m, pull = sm.Machine(replace(d, legs=legs)), np.array([5.0, -20.0, 12.0])
    s = m.solve((SPAN, 0, 0), wrenches={"swing.hook": [*pull, 0, 0, 0]}, read_points=["swing.hook"])
    assert s.status == sm.Status.CONVERGED and not s.flags & sm.Flag.FREE_SPIN
    across = np.array([0, *pull[1:]]) / np.hypot(*pull[1:])
    # from (0, 0, OFF) beside the rod to OFF along the force
    moved = s.readings[1, :3] + (0, 0, OFF)
    np.testing.assert_allclose(moved[1:], OFF * across[1:], atol=1e-4)


def test_a_spring_about_the_rod_decides_how_far_it_turns() -> None:
    """A soft ball resists the spin: the weight turns the rod against it, by the pendulum's own equation."""
    stiff = MASS * G * OFF  # N·m/rad
    s = slanted(np.eye(3), stiff).solve((SPAN, 0, 0), gravity=GRAVITY)
    assert s.status == sm.Status.CONVERGED and not s.flags & sm.Flag.FREE_SPIN
    turn = s.coordinates[[n.startswith("swing.low") for n in s.coordinate_names]]
    # about x alone, but for the sag: the weight's moment against the spring
    angle = brentq(lambda t: stiff * t + MASS * G * OFF * np.cos(0.4 + t), -2, 2)
    assert turn[0] == pytest.approx(angle, abs=1e-4)


@pytest.mark.parametrize("name", ["linear-delta", "rotary-delta", "hexapod"])
def test_no_spring_lets_go_of_a_rod_between_balls(name: str) -> None:
    """A force along the line of the rod is all that it carries: what its springs are across changes nothing."""
    machine = sm.load_machine(name)
    rng = np.random.default_rng(2)

    def coupled(e: Spring) -> Spring:
        root = rng.standard_normal((6, 6))
        size = np.sqrt(np.diag(np.array(e.compliance)))
        return replace(e, compliance=b.matrix((root @ root.T + np.eye(6)) * np.outer(size, size)))

    def edit(elements: tuple[Element, ...]) -> tuple[Element, ...]:
        return tuple(coupled(e) if isinstance(e, Spring) and e.compliance else e for e in elements)

    d = machine.description
    legs = tuple(replace(leg, elements=edit_sequences(leg.elements, edit)) for leg in d.legs)
    other = sm.Machine(replace(d, legs=legs), like=machine)
    assert machine.free_spins
    assert other.free_spins == machine.free_spins
    assert sm.Machine(other.description).free_spins == machine.free_spins


def swivel(*across: float) -> MachineDescription:
    """A platform on a spring, and on a leg with a body between two hinges on one line; N/m of the body along its x and y."""
    turning = (
        b.revolute("low"),
        b.shift("up", (0, 0, 0.1)),
        b.stiff("yield", np.diag([*across, 1e6, 1e3, 1e3, 1e3])),
        Point("hook", (0.1, 0.0, 0.0)),
        b.shift("on", (0, 0, 0.1)),
        b.revolute("high"),
    )
    hold = (b.shift("to", TIP), b.stiff("hold", np.diag([1e6, 1e6, 1e6, 1e3, 1e3, 1e3])))
    return MachineDescription("swivel", (Leg("hold", hold), Leg("turning", turning)), home=Pose.of(TIP))


def test_a_spin_that_springs_decide_on_is_judged_again() -> None:
    alike, uneven = sm.Machine(swivel(1e6, 1e6)), swivel(1e6, 4e6)
    assert len(alike.free_spins) == 1
    for made in (sm.Machine(uneven), sm.Machine(uneven, like=alike)):
        assert not made.free_spins
        assert made.solve(TIP).flags & sm.Flag.CONFIGURATION_UNDETERMINED
        assert sm.Machine(swivel(1e6, 1e6), like=made).free_spins == alike.free_spins


def test_a_cable_on_the_body_that_turns_is_asked_for() -> None:
    alike = sm.Machine(swivel(1e6, 1e6))
    cable = ExternalSpring("cable", "turning.hook", (0.3, 0.0, 0.1), 2e6, 0.25)
    pulled = replace(alike.description, external_springs=(cable,))
    for made in (sm.Machine(pulled), sm.Machine(pulled, like=alike)):
        assert not made.free_spins

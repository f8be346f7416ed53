"""A ball joint is a ball joint, whatever axes number its rotations; axes that are meant must not lock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.oracle.compare import compare_machine
from tests.oracle.generate import Generator

import stiffmap as sm
from stiffmap.model.description import Block, Branch, Element, Joint, Law, MachineDescription, Offset, Pose
from stiffmap.model.files import description_from_text, description_text, load_description

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
CHARTS = ("xyz", "zxz", "xyx", "yzy", "zyx", "yxz")  # at zero, those with a repeated letter lock
Change = Callable[[Joint], tuple[Element, ...]]


def home_turn(e: Joint) -> np.ndarray:
    """(3, 3) rotation of a ball joint at home, by SciPy."""
    turn = np.eye(3)
    for axis, angle in zip(e.axes, e.home, strict=True):
        turn = turn @ Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
    return turn


def in_chart(letters: str) -> Change:
    """The same ball joint: its home rotation as an offset, then three axes at zero."""

    def change(e: Joint) -> tuple[Element, ...]:
        new = replace(e, axes=tuple(AXES[a] for a in letters), home=(0.0, 0.0, 0.0))
        return (Offset(f"{e.name}_turn", Pose.of((0, 0, 0), home_turn(e))), new)

    return change


def with_balls(d: MachineDescription, change: Change) -> MachineDescription:
    """The machine with every ball joint changed."""

    def walk(elements: tuple[Element, ...]) -> tuple[Element, ...]:
        out: list[Element] = []
        for e in elements:
            if isinstance(e, Block):
                out.append(replace(e, branches=tuple(Branch(b.name, walk(b.elements)) for b in e.branches)))
            else:
                out += change(e) if isinstance(e, Joint) and e.kind == "spherical" else (e,)
        return tuple(out)

    return replace(d, legs=tuple(replace(leg, elements=walk(leg.elements)) for leg in d.legs))


def poses(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    p = np.array([0, 0, 0.7]) + rng.uniform(-0.05, 0.05, (n, 3))
    r = Rotation.from_rotvec(rng.uniform(-0.15, 0.15, (n, 3))).as_matrix()
    p[0], r[0] = (0, 0, 0.7), np.eye(3)
    return p, r


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("name", ["hexapod", "3-rps"])
def test_every_chart_gives_the_same_machine(name: str, method: str) -> None:
    declared = load_description(name)
    wrench = [300, -200, 100, 0, 0, 0]
    if name == "hexapod":
        p, r = poses(6)
    else:
        p, r = declared.home.p + np.array([[0, 0, 0], [0, 0, 0.03], [0, 0, -0.02]]), np.eye(3)
    expected = sm.Machine(declared).solve(p, wrench, rotation=r, method=method)
    assert (expected.status == sm.Status.CONVERGED).all()
    for letters in CHARTS:
        m = sm.Machine(with_balls(declared, in_chart(letters)))
        s = m.solve(p, wrench, rotation=r, method=method)
        assert (s.status == sm.Status.CONVERGED).all()
        for value, wanted in ((s.compliance, expected.compliance), (s.displacement, expected.displacement)):
            assert np.abs(value - wanted).max() < 1e-9 * np.abs(wanted).max(), letters


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("legs", [("a",), ("a", "b", "c")])
def test_hinges_that_coincide_at_home_are_no_spin(legs: tuple[str, ...], method: str) -> None:
    """Three hinges z, x, z: at home what lies between turns freely, and with it the direction that is blocked; off
    home they are a ball joint again."""
    declared = load_description("3-rps")

    def hinges(e: Joint) -> tuple[Element, ...]:
        axes = ("z", "x", "z")
        return (
            Offset("turn", Pose.of((0, 0, 0), home_turn(e))),
            *(Joint(f"hinge{i}", "revolute", (AXES[a],), (0.0,)) for i, a in enumerate(axes)),
        )

    changed = with_balls(declared, hinges)
    mixed = replace(
        declared,
        legs=tuple(
            new if new.name in legs else old for old, new in zip(declared.legs, changed.legs, strict=True)
        ),
    )
    machine, wrench = sm.Machine(mixed), [300, -200, 100, 0, 0, 0]
    assert machine.solve(declared.home.p, wrench, method=method).status == sm.Status.SINGULAR
    for tilt in (1e-3, 0.1):
        turned = np.array(declared.home.r) @ Rotation.from_rotvec([tilt, 0.7 * tilt, 0]).as_matrix()
        s, ball = (
            m.solve(declared.home.p, wrench, rotation=turned, method=method)
            for m in (machine, sm.Machine(declared))
        )
        assert s.status == sm.Status.CONVERGED
        np.testing.assert_allclose(s.displacement, ball.displacement, atol=1e-9)
        assert np.abs(s.compliance - ball.compliance).max() < 1e-6 * np.abs(ball.compliance).max()


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("letters", ["zxz", "xyx"])
def test_a_pose_that_a_locked_hinge_must_turn_to_is_reached(letters: str, method: str) -> None:
    """Three hinges of which two coincide at home: a tilt about the third perpendicular needs the first at a right angle,
    to which no way leads from home."""
    declared = load_description("3-rps")

    def hinges(e: Joint) -> tuple[Element, ...]:
        return (
            Offset("turn", Pose.of((0, 0, 0), home_turn(e))),
            *(Joint(f"hinge{i}", "revolute", (AXES[a],), (0.0,)) for i, a in enumerate(letters)),
        )

    machine, wrench = sm.Machine(with_balls(declared, hinges)), [300, -200, 100, 0, 0, 0]
    balls = sm.Machine(declared)
    home, answered = np.array(declared.home.r), 0
    for direction in (
        np.eye(3)[:2] if letters == "zxz" else np.eye(3)[1:2]
    ):  # a tilt about x keeps x, y, x locked
        for tilt in (-0.1, 0.02, 0.1):
            turned = Rotation.from_rotvec(tilt * direction).as_matrix() @ home
            s, ball = (
                m.solve(declared.home.p, wrench, rotation=turned, method=method) for m in (machine, balls)
            )
            assert s.status == ball.status == sm.Status.CONVERGED
            np.testing.assert_allclose(s.displacement, ball.displacement, atol=1e-9)
            assert np.abs(s.compliance - ball.compliance).max() < 1e-6 * np.abs(ball.compliance).max()
            answered += bool(s.flags & sm.Flag.BRANCH_UNVERIFIED)
    assert answered == (6 if letters == "zxz" else 0)


def determined(d: MachineDescription) -> bool:
    """Whether the machine resists every motion of its platform at home, without a load."""
    return bool(sm.Machine(d).solve(d.home.p, rotation=d.home.r).status == sm.Status.CONVERGED)


def machine_with_a_ball(seed: int) -> tuple[MachineDescription, Generator]:
    """Random machines until one has ball joints, all of them free, and is not singular at home."""
    while True:
        generator = Generator(seed)
        d = generator.random_legs()
        balls = [e for leg in d.legs for e in leg.elements if isinstance(e, Joint) and e.kind == "spherical"]
        if balls and all(e.law is None for e in balls) and determined(with_balls(d, in_chart("xyz"))):
            return d, generator
        seed += 100


@pytest.mark.parametrize("letters", ["xyz", "zxz", "yzy"])
@pytest.mark.parametrize("seed", range(3))
def test_free_balls_against_energy_minimisation(seed: int, letters: str) -> None:
    """The oracle walks the perpendicular axes, the core the chart."""
    d, generator = machine_with_a_ball(seed)
    loads = generator.loads(d)
    truth, *_ = compare_machine(with_balls(d, in_chart("xyz")), loads)
    p, w = d.home.p, [*loads.force, *loads.moment]
    options = {
        "load_type": "semitangential" if loads.moment.any() else "dead",
        "wrenches": {n: [*f, 0, 0, 0] for n, f in loads.at_points.items()},
        "gravity": loads.gravity,
    }
    assert truth.gap < 1e-6 and truth.status == sm.Status.CONVERGED
    right = sm.Machine(with_balls(d, in_chart("xyz"))).solve(p, w, **options)
    for method in ("fast", "reference"):
        s = sm.Machine(with_balls(d, in_chart(letters))).solve(p, w, method=method, **options)
        assert s.status == sm.Status.CONVERGED
        assert np.abs(s.compliance - right.compliance).max() < 1e-9 * np.abs(right.compliance).max()


@pytest.mark.parametrize("seed", range(3))
def test_one_stiffness_per_axis_and_rest_against_energy_minimisation(seed: int) -> None:
    d, generator = machine_with_a_ball(seed)
    rng = np.random.default_rng(seed)

    def sprung(e: Joint) -> tuple[Element, ...]:
        laws = tuple(Law(float(k)) for k in rng.uniform(2e3, 2e4, 3))
        rest = tuple(q + float(a) for q, a in zip(e.home, rng.uniform(-2e-4, 2e-4, 3), strict=True))
        return (replace(e, axis_laws=laws, rest=rest),)

    changed = with_balls(d, sprung)
    for c in compare_machine(changed, generator.loads(d)):
        assert c.truth == "found" and c.status == sm.Status.CONVERGED
        assert c.gap < 1e-8


BALL = """
name: stand
units: {{length: mm, force: N, angle: deg}}
home: {{translation: [0, 0, 500]}}
legs:
  only:
    elements:
      - {{actuator: lift, kind: prismatic, axis: z, home: 100, rigid: true}}
      - {{joint: ball, kind: spherical, axes: [{axes}], {rest}}}
      - {{offset: rod, translation: [0, 0, 400]}}
"""


def stand(axes: str, rest: str = "stiffness: [1e5, 2e5, 3e5]") -> sm.Machine:
    return sm.Machine(description_from_text(BALL.format(axes=axes, rest=rest)))


def test_one_stiffness_per_axis_in_closed_form() -> None:
    m = stand("x, y, z")
    moment = 0.01
    for i, k in enumerate((100.0, 200.0, 300.0)):  # N·m/rad
        w = np.zeros(6)
        w[3 + i] = moment
        d = m.solve([0, 0, 0.5], w).displacement
        assert d[3 + i] == pytest.approx(moment / k, rel=1e-9)
    force = m.solve([0, 0, 0.5], [1e-3, 0, 0, 0, 0, 0]).displacement
    assert force[0] == pytest.approx(1e-3 * 0.4**2 / 200.0, rel=1e-6)


def test_rest_is_where_a_joint_is_free_of_force() -> None:
    m = stand("x, y, z", "stiffness: [1e5, 2e5, 3e5], rest: [0, 0, 0.2]")
    s = m.solve([0, 0, 0.5])
    assert s.displacement[3:] == pytest.approx([0, 0, np.radians(0.2)], abs=1e-12)
    held = m.solve([0, 0, 0.5], [0, 0, 0, 0, 0, -300.0 * np.radians(0.2)])
    assert held.displacement == pytest.approx(np.zeros(6), abs=1e-12)


def test_a_file_keeps_stiffness_per_axis_and_rest() -> None:
    d = stand("x, y, z", "stiffness: [1e5, 2e5, 3e5], rest: [0, 0.1, 0.2]").description
    back = description_from_text(description_text(d))
    assert back == d
    joint = back.legs[0].elements[1]
    assert isinstance(joint, Joint) and [law.stiffness for law in joint.axis_laws] == [100.0, 200.0, 300.0]


@pytest.mark.parametrize("rest", ["stiffness: 1e5", "limits: [-30, 30], stiffness: [1e5, 1e5, 1e5]"])
def test_axes_that_are_meant_must_not_lock_at_home(rest: str) -> None:
    with pytest.raises(sm.StiffmapError, match=r"joint ball: .*gimbal lock"):
        stand("z, x, z", rest)


def test_neighbouring_axes_must_not_be_parallel() -> None:
    with pytest.raises(sm.StiffmapError, match=r"joint ball: axes 1 and 2 .* must not be parallel"):
        stand("z, z, x")


def test_near_lock_is_flagged() -> None:
    """The second axis, turned by a right angle from home, brings the first and the third together."""
    m = stand("x, y, z")
    for angle, flagged in ((80, False), (89.5, True), (-89.5, True)):
        turn = Rotation.from_euler("y", angle, degrees=True).as_matrix()
        p = np.array([0, 0, 0.1]) + turn @ [0, 0, 0.4]
        for method in ("fast", "reference"):
            s = m.solve(p, rotation=turn, method=method)
            assert bool(s.flags & sm.Flag.GIMBAL_LOCK) == flagged

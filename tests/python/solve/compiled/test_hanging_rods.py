"""Rods whose centre of mass is off the line of their balls hang, in the kernels as in the reference path (theory C10,
docs/fast_path.md F21)."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import TOLERANCE, compare, draw

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.description import Body, Joint, Leg, MachineDescription, Offset, Pose, Spring

GRAVITY = (0.0, 0.0, -9.81)
OFFSET = {"error_x": 2e-4, "error_z": -1e-4}
SPAN, MASS, OFF = 0.4, 2.0, 0.05
CASES = {
    "linear-delta": ("position_offset", "ball_lower", OFFSET),
    "rotary-delta": ("position_offset", "ball_lower", OFFSET),
    "hybrid": ("position_offset", "ball_lower", OFFSET),
    "hexapod": ("position_offset", "ball", OFFSET),
    "hexapod tilted": ("axis_tilt", "spin", {"angle_x": 1e-3, "angle_y": 2e-3}),
}


def with_hanging_rods(case: str, legs: list[str] | None = None) -> sm.Machine:
    kind, element, values = CASES[case]
    return sm.load_machine(case.split()[0]).with_effect(kind, element=element, legs=legs, **values)


@pytest.mark.parametrize("case", CASES)
def test_as_the_reference_finds_them(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = with_hanging_rods(case)
    position, wrench = draw(machine, 8, seed=7)
    expected = machine.solve(position, wrench, gravity=GRAVITY, method="reference")
    assert not (expected.flags & sm.Flag.FREE_SPIN).any()
    for level in _core.kernel_levels():
        monkeypatch.setenv("STIFFMAP_ISA", level)
        found = machine.solve(position, wrench, gravity=GRAVITY)
        assert found.reference_share == 0
        gap = compare(found, expected)
        assert gap.statuses == 0 and gap.poses == 8
        assert gap.worst() < TOLERANCE
        assert not (found.flags & sm.Flag.FREE_SPIN).any()
        assert not found.indeterminate_mask.any()
        turned = np.abs(found.coordinates - expected.coordinates)
        np.testing.assert_array_less(np.minimum(turned, np.abs(turned - 2 * np.pi)), 1e-8)
        np.testing.assert_allclose(found.leg_wrench, expected.leg_wrench, atol=1e-9)


@pytest.mark.parametrize("kind", ["follower", "semitangential"])
def test_under_a_load_that_turns(kind: str) -> None:
    machine = with_hanging_rods("linear-delta")
    position, wrench = draw(machine, 8, seed=8)
    options = {"gravity": (1.0, -3.0, -9.0), "load_type": kind}
    found = machine.solve(position, wrench, **options)
    assert found.reference_share == 0
    gap = compare(found, machine.solve(position, wrench, method="reference", **options))
    assert gap.statuses == 0
    assert gap.worst() < TOLERANCE


def test_only_the_rods_that_weights_turn_are_let_go() -> None:
    machine = with_hanging_rods("linear-delta", legs=["b"])
    position, wrench = draw(machine, 8, seed=9)
    found = machine.solve(position, wrench, gravity=GRAVITY)
    expected = machine.solve(position, wrench, gravity=GRAVITY, method="reference")
    assert found.reference_share == 0
    assert (found.flags & sm.Flag.FREE_SPIN).all()
    np.testing.assert_array_equal(found.indeterminate_mask, expected.indeterminate_mask)
    assert found.indeterminate_mask.sum(axis=1).tolist() == [4] * 8
    gap = compare(found, expected)
    assert (gap.statuses, gap.poses) == (0, 8)
    assert gap.worst() < TOLERANCE


@pytest.mark.parametrize("times", [1.0, 5.0])
def test_a_large_load_beside_light_rods(times: float) -> None:
    """Which spins a load turns is told by a moment of round-off of all loads: next to that the reference decides."""
    machine = with_hanging_rods("linear-delta")
    position, _ = draw(machine, 16, seed=5)
    force = times * np.array([100.0, 50, -200, 0, 0, 0])
    found = machine.solve(position, force, gravity=GRAVITY)
    expected = machine.solve(position, force, gravity=GRAVITY, method="reference")
    np.testing.assert_array_equal(found.indeterminate_mask, expected.indeterminate_mask)
    np.testing.assert_array_equal((found.flags ^ expected.flags) & sm.Flag.FREE_SPIN, 0)
    gap = compare(found, expected)
    assert (gap.statuses, gap.poses) == (0, 16)
    assert gap.worst() < TOLERANCE


@pytest.mark.parametrize("name", ["hexapod", "linear-delta"])
def test_every_joint_is_off_its_place(name: str) -> None:
    """Axes that are not in line with the balls: on the hexapod a spin then pulls at the platform."""
    machine = sm.load_machine(name)
    for element in {
        "hexapod": ("cardan", "strut", "ball"),
        "linear-delta": ("carriage", "ball_upper", "ball_lower"),
    }[name]:
        machine = machine.with_effect("position_offset", element=element, **OFFSET)
    machine = machine.with_effect("position_offset", element="base", **OFFSET)
    position, wrench = draw(machine, 16, seed=11)
    found = machine.solve(position, wrench, gravity=GRAVITY)
    assert found.reference_share == 0
    gap = compare(found, machine.solve(position, wrench, gravity=GRAVITY, method="reference"))
    assert gap.statuses == 0
    assert gap.worst() < TOLERANCE


def rod(angle: float) -> sm.Machine:
    """A platform on springs at both ends of a level rod, its centre of mass turned by `angle` about it."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    stiff = tuple(tuple(float(v) for v in row) for row in np.diag([1e6] * 3 + [1e4] * 3))
    swing = (
        Joint("low", "spherical", axes, home=(0.0, 0.0, 0.0)),
        Body("rod", MASS, (SPAN / 2, OFF * np.cos(angle), OFF * np.sin(angle))),
        Offset("length", Pose.of((SPAN, 0, 0))),
        Spring("yield", stiffness=stiff),
        Joint("high", "spherical", axes, home=(0.0, 0.0, 0.0)),
    )
    hold = (Offset("to", Pose.of((SPAN, 0, 0))), Spring("hold", stiffness=stiff))
    legs = (Leg("hold", hold), Leg("swing", swing))
    return sm.Machine(MachineDescription("rod", legs, home=Pose.of((SPAN, 0, 0))))


@pytest.mark.parametrize("angle", [-3.1, -2.0, -1.5, 0.0, 0.7, 1.57, 3.0])
def test_a_level_rod_hangs_with_its_centre_below(angle: float) -> None:
    """Half of the weight at either end, nothing across; free to turn as a pendulum of its weight times the lever."""
    machine = rod(angle)
    s = machine.solve((SPAN, 0, 0), gravity=GRAVITY)
    assert s.status == sm.Status.CONVERGED
    assert s.reference_share == 0
    assert s.displacement[2] == pytest.approx(-MASS * 9.81 / 2 / 1e6, rel=1e-3)
    assert abs(s.displacement[1]) < 1e-3 * abs(s.displacement[2])
    turn = s.coordinates[s.coordinate_names.index("swing.low.3")]
    down = (-np.pi / 2 - angle + np.pi) % (2 * np.pi) - np.pi
    assert turn == pytest.approx(down, abs=1e-3)
    # the springs hold the centre's lever too: across, a force turns the rod as much as the weight lets it
    step = 0.5
    for i in range(3):
        both = machine.solve((SPAN, 0, 0), np.stack([np.eye(6)[i], -np.eye(6)[i]]) * step, gravity=GRAVITY)
        slope = (both.displacement[0] - both.displacement[1]) / (2 * step)
        size = np.sqrt(np.diag(s.compliance) * s.compliance[i, i])
        np.testing.assert_allclose(slope[:3] / size[:3], s.compliance[:3, i] / size[:3], atol=1e-6)

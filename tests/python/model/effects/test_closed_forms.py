"""Effects against closed forms, on a slider that a force pushes along its guide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Joint, Law, Leg, MachineDescription, Offset, Pose, Spring
from stiffmap.model.effects import get

C = 2e-8  # m/N, drive
LINK = 5e-8  # m/N, link along the guide


def slider() -> sm.Machine:
    """Three crossed drives carry the tool; along x a drive and a link in series."""

    def drive(name: str, axis: tuple[float, float, float]) -> Joint:
        return Joint(name, "prismatic", (axis,), actuated=True, law=Law(1 / C))

    compliance = tuple(
        tuple(v if i == j else 0.0 for j in range(6)) for i, v in enumerate([LINK] + [1e-9] * 5)
    )
    elements = (
        drive("x", (1.0, 0.0, 0.0)),
        drive("y", (0.0, 1.0, 0.0)),
        drive("z", (0.0, 0.0, 1.0)),
        Offset("length", Pose.of([0.5, 0.0, 0.0])),
        Spring("link", compliance=compliance),
    )
    task = {"task": ("x", "y", "z")} if "task" in MachineDescription.__dataclass_fields__ else {}
    return sm.Machine(
        MachineDescription("slider", (Leg("arm", elements),), home=Pose.of([0.5, 0.0, 0.0]), **task)
    )


def deflection(machine: sm.Machine, force: np.ndarray | float) -> np.ndarray:
    """Displacement along x under forces along x."""
    wrench = np.zeros((*np.shape(force), 6))
    wrench[..., 0] = force
    return np.asarray(machine.solve(machine.description.home.p, wrench).displacement)[..., 0]


FORCES = np.array([-300.0, -40.0, 15.0, 80.0, 500.0])


def test_dead_zone_in_series_with_a_spring():
    machine = slider().with_effect("dead_zone", element="x", half_width=1e-5)
    expected = (C + LINK) * FORCES + 1e-5 * np.sign(FORCES)
    assert deflection(machine, FORCES) == pytest.approx(expected, abs=1e-15)


def test_hardening_solves_its_cubic():
    machine = slider().with_effect("hardening", element="x", cubic=1e17)
    a = deflection(machine, FORCES) - LINK * FORCES
    assert a / C + 1e17 * a**3 == pytest.approx(FORCES, rel=1e-10)


def test_bilinear_beyond_its_knee():
    machine = slider().with_effect("bilinear", element="x", ratio=3.0, knee=50.0)
    inside = np.clip(FORCES, -50, 50)
    expected = LINK * FORCES + C * (inside + 3.0 * (FORCES - inside))
    assert deflection(machine, FORCES) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(("branch", "sign"), [("loading", -1.0), ("unloading", 1.0)])
def test_friction_shifts_each_branch_by_the_level(branch, sign):
    machine = slider().with_effect("friction", element="x", force=10.0, branch=branch)
    expected = (C + LINK) * FORCES + sign * C * 10.0 * np.sign(FORCES)
    assert deflection(machine, FORCES) == pytest.approx(expected, abs=1e-15)


def test_stuck_drive_does_not_move_below_the_level():
    machine = slider().with_effect("friction", element="x", force=60.0, branch="loading_stuck")
    soft = np.sign(FORCES) * np.maximum(np.abs(FORCES) - 60.0, 0.0)
    assert deflection(machine, FORCES) == pytest.approx(C * soft + LINK * FORCES, abs=1e-15)


def test_area_between_the_branches_is_the_energy_that_friction_takes():
    """Per half cycle: friction force times twice the path of the spring between them, 2 c L (Fmax - Fmin)."""
    level, force = 10.0, np.linspace(100.0, 400.0, 31)
    up, down = (
        deflection(slider().with_effect("friction", element="x", force=level, branch=b), force)
        for b in ("loading", "unloading")
    )
    assert np.trapezoid(down - up, force) == pytest.approx(2 * C * level * 300.0, rel=1e-10)


def test_dead_zone_and_friction_add_up():
    machine = slider()
    for order in (("dead_zone", "friction"), ("friction", "dead_zone")):
        changed = machine
        for kind in order:
            size = {"half_width": 1e-5} if kind == "dead_zone" else {"force": 10.0, "branch": "unloading"}
            changed = changed.with_effect(kind, element="x", **size)
        expected = (C + LINK) * FORCES + (1e-5 + 10.0 * C) * np.sign(FORCES)
        assert deflection(changed, FORCES) == pytest.approx(expected, abs=1e-15)


def test_compliance_scales():
    for element, extra in (("x", C), ("link", LINK), ("link.k11", LINK)):
        machine = slider().with_effect("compliance", element=element, scale=2.5)
        assert deflection(machine, FORCES) == pytest.approx((C + LINK + 1.5 * extra) * FORCES, rel=1e-12)


def test_compliance_value_is_the_new_total():
    machine = slider().with_effect("compliance", element="x", value=7e-8)
    assert deflection(machine, FORCES) == pytest.approx((7e-8 + LINK) * FORCES, rel=1e-12)


@pytest.mark.parametrize(("x", "slope"), [(0.7, 2.0), (0.2, -1.0)])
def test_compliance_along_the_stroke(x, slope):
    machine = slider().with_effect("position_dependent_compliance", element="x", slope=slope)
    got = machine.solve([x, 0.0, 0.0], [100.0, 0, 0, 0, 0, 0]).displacement[0]
    assert got == pytest.approx((C * (1 + slope * (x - 0.5)) + LINK) * 100.0, rel=1e-12)


def test_errors_of_the_command_along_the_stroke():
    x = np.linspace(0.2, 0.9, 8)
    position = np.stack([x, 0 * x, 0 * x], axis=-1)
    machine = slider().with_effect("zero_offset", element="x", error=1e-4)
    machine = machine.with_effect("lead_error", element="x", slope=2e-4)
    machine = machine.with_effect("periodic_error", element="x", amplitude=1e-5, period=0.04, phase=0.7)
    u = x - 0.5
    expected = 1e-4 + 2e-4 * u + 1e-5 * np.sin(2 * np.pi * u / 0.04 + 0.7)
    assert machine.solve(position).displacement[:, 0] == pytest.approx(expected, abs=1e-15)


def test_lengths_and_temperature():
    longer = slider().with_effect("length", element="link", error=1e-4)
    warm = slider().with_effect(
        "thermal_growth", element="link", coefficient=1.2e-5, temperature_difference=8.0
    )
    assert deflection(longer, 0.0) == pytest.approx(1e-4, abs=1e-15)
    assert deflection(warm, 0.0) == pytest.approx(0.5 * 1.2e-5 * 8.0, abs=1e-15)


def test_tilted_guide_runs_off_with_the_stroke():
    """The tool stands 0.5 m before the carriage, and the carriage at home where it was."""
    machine = slider().with_effect("tilt", element="x", angle_z=1e-4)
    y = machine.solve([[0.5, 0, 0], [0.8, 0, 0]]).displacement[:, 1]
    assert y == pytest.approx([0.5 * np.sin(1e-4), 0.8 * np.sin(1e-4)], rel=1e-9)


def test_tilted_axis_alone_leaves_home_as_it_is():
    machine = slider().with_effect("axis_tilt", element="x", angle_z=1e-4)
    y = machine.solve([[0.5, 0, 0], [0.8, 0, 0]]).displacement[:, 1]
    assert y == pytest.approx([0.0, 0.3 * np.sin(1e-4)], abs=1e-15)


def test_offsets_move_the_tool():
    for kind, element, sign in (
        ("position_offset", "x", 1.0),
        ("position_offset", "base", 1.0),
        ("position_offset", "platform", -1.0),  # the joint point goes one way, the platform the other
        ("tcp_offset", "platform", 1.0),
    ):
        machine = slider().with_effect(kind, element=element, error_y=1e-4)
        moved = machine.solve([0.5, 0, 0]).displacement[:3]
        assert moved == pytest.approx([0, sign * 1e-4, 0], abs=1e-15), kind


def test_base_and_tool_yield_about_their_pivots():
    force, arm = 100.0, 0.5
    wrench = [0, force, 0, 0, 0, 0]
    plain = slider().solve([arm, 0, 0], wrench).displacement[1]
    base = slider().with_effect("base_compliance", translation=1e-8, rotation=1e-7, pivot_x=0.1)
    got = base.solve([arm, 0, 0], wrench).displacement[1]
    assert got - plain == pytest.approx(force * (1e-8 + 1e-7 * (arm - 0.1) ** 2), rel=1e-5)
    tool = slider().with_effect("tool_compliance", translation=1e-8, rotation=1e-7, pivot_x=-0.2)
    got = tool.solve([arm, 0, 0], wrench).displacement[1]
    assert got - plain == pytest.approx(force * (1e-8 + 1e-7 * 0.2**2), rel=1e-5)


def test_payload_is_a_weight_in_a_machine_without_gravity():
    machine = slider().with_effect("payload", mass=3.0, com_x=0.1)
    push = slider().solve([0.5, 0, 0], [0, 0, -3.0 * 9.81, 0, 0.1 * 3.0 * 9.81, 0])
    assert machine.solve([0.5, 0, 0]).displacement == pytest.approx(push.displacement, abs=1e-12)


def test_payload_follows_the_gravity_of_the_machine(orthoglide):
    heavy = orthoglide.with_effect("gravity", scale=1.0)
    added = heavy.with_effect("payload", mass=3.0)
    alone = heavy.solve([0, 0, 0], [0, 0, -3.0 * 9.81, 0, 0, 0])
    assert added.solve([0, 0, 0]).displacement == pytest.approx(alone.displacement, abs=1e-12)


def test_external_spring_pulls_towards_its_anchor():
    machine = slider().with_effect(
        "external_spring",
        element="tcp",
        stiffness=1000.0,
        length=0.2,
        anchor_x=0.5,
        anchor_y=0.0,
        anchor_z=1.0,
    )
    z = machine.solve([0.5, 0, 0]).displacement[2]
    assert z * (1 / (C + 1e-9) + 1000.0) == pytest.approx(1000.0 * (1.0 - 0.2), rel=1e-6)


def test_preload_moves_the_rest_of_a_link():
    machine = slider().with_effect("preload", element="link", rest_x=3e-5)
    assert deflection(machine, FORCES) == pytest.approx((C + LINK) * FORCES + 3e-5, abs=1e-15)


def test_equal_lengths_cancel_in_the_difference_of_the_rods(orthoglide):
    """Both rods longer by one error is `length`; the difference leaves their mean."""
    position = [[0.12, -0.08, 0.21]]
    both = orthoglide.with_effect("length", element="bar", legs=["x"], error=1e-4)
    bars = orthoglide.with_effect("length_difference", element="parallelogram", legs=["x"], difference=1e-4)
    plain = orthoglide.solve(position).displacement
    along = [np.linalg.norm((m.solve(position).displacement - plain)[0, :3]) for m in (both, bars)]
    turned = [np.linalg.norm((m.solve(position).displacement - plain)[0, 3:]) for m in (both, bars)]
    assert along[0] > 3 * along[1]
    assert turned[1] > 3 * turned[0]


def test_clearance_of_pins_is_play_of_the_tool(orthoglide):
    """Two pins in line with the guide's force: the tool gains the radius of both."""
    machine = orthoglide.with_effect("joint_clearance", element="bar", legs=["x"], radius=1e-5)
    wrench = [300.0, 0, 0, 0, 0, 0]
    gain = machine.solve([0, 0, 0], wrench).displacement - orthoglide.solve([0, 0, 0], wrench).displacement
    assert gain[0] == pytest.approx(2e-5, rel=1e-3)


def test_elements_of_base_and_platform_have_no_leg(orthoglide):
    """A spring in the base, and one entry of it."""
    d = orthoglide.description
    compliance = tuple(tuple(1e-8 if i == j else 0.0 for j in range(6)) for i in range(6))
    machine = sm.Machine(replace(d, base=(Spring("floor", compliance=compliance), *d.base)))
    wrench = [100.0, 0, 0, 0, 0, 0]
    plain = machine.solve([0, 0, 0], wrench).displacement[0]
    for element in ("floor", "floor.k11"):
        changed = machine.with_effect("compliance", element=element, scale=3.0)
        assert changed.description.effects[0].legs == ()
        gain = changed.solve([0, 0, 0], wrench).displacement[0] - plain
        assert gain == pytest.approx(2 * 1e-8 * 100.0, rel=1e-6)


def test_angles_on_a_drive_that_turns():
    """A robot arm of one joint: its numbers are in rad and rad/(N·m)."""
    joint = Joint("hip", "revolute", ((0.0, 0.0, 1.0),), actuated=True, law=Law(1e5))
    arm = (joint, Offset("arm", Pose.of([0.5, 0.0, 0.0])))
    task = {"task": ("y",)} if "task" in MachineDescription.__dataclass_fields__ else {}
    machine = sm.Machine(MachineDescription("arm", (Leg("a", arm),), home=Pose.of([0.5, 0, 0]), **task))
    units = {p.name: p.unit for p in get("dead_zone").parameters_at(machine.description, "hip", ("a",))}
    assert units == {"half_width": "rad"}
    wrench = [0, 100.0, 0, 0, 0, 0]
    plain = machine.solve([0.5, 0, 0], wrench).displacement[5]
    changed = machine.with_effect("compliance", element="hip", value=3e-5)
    assert plain == pytest.approx(1e-5 * 50.0, rel=1e-3)
    assert changed.solve([0.5, 0, 0], wrench).displacement[5] == pytest.approx(3e-5 * 50.0, rel=1e-3)

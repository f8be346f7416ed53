"""Both paths agree on machines with effects, and on each of their branches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import TOLERANCE, draw, gap

import stiffmap as sm

Effect = tuple[str, dict[str, Any]]
EFFECTS: dict[str, list[Effect]] = {
    "dead_zone": [("dead_zone", {"element": "actuator", "legs": ["y"], "half_width": 12e-6})],
    "friction_loading": [("friction", {"element": "actuator", "force": 30.0, "branch": "loading"})],
    "friction_unloading": [("friction", {"element": "actuator", "force": 30.0, "branch": "unloading"})],
    "hardening": [("hardening", {"element": "actuator", "cubic": 1e13})],
    "joint_compliance": [
        ("joint_compliance", {"element": "bar", "translation": 1e-9, "rotation": 1e-7, "legs": ["x"]})
    ],
    "tilt": [("tilt", {"element": "actuator", "legs": ["z"], "angle_x": 1e-3, "angle_y": -5e-4})],
    "length": [("length", {"element": "bar", "legs": ["y"], "error": 5e-5})],
    "hardening_of_a_bar": [("hardening", {"element": "bar.k11", "cubic": 1e16})],
    "tabulated": [("tabulated", {"element": "actuator", "step": 1e-5, "factor_1": 0.5, "factor_3": 0.8})],
    "straightness": [
        ("straightness", {"element": "actuator", "amplitude": 2e-5, "period": 0.4, "phase": 0.5}),
        (
            "straightness",
            {"element": "actuator", "legs": ["z"], "amplitude": 3e-5, "period": 1.1, "across": "z"},
        ),
    ],
    **{
        f"joint_friction_{branch}": [
            ("joint_friction", {"element": joint, "torque": 0.3, "branch": branch})
            for joint in ("proximal", "distal", "pin_proximal", "pin_distal")
        ]
        for branch in ("loading", "unloading")
    },
    "joint_friction_stuck": [("joint_friction", {"element": "pin_distal", "torque": 0.3})],
    "several": [
        ("dead_zone", {"element": "actuator", "legs": ["x"], "half_width": 5e-6}),
        ("friction", {"element": "actuator", "force": 20.0, "branch": "loading", "legs": ["y", "z"]}),
        ("length", {"element": "bar", "legs": ["z"], "error": 3e-5}),
    ],
}


def with_effects(effects: list[Effect]) -> sm.Machine:
    machine = sm.load_machine("orthoglide-revised")
    for kind, values in effects:
        machine = machine.with_effect(kind, **values)
    return machine


@pytest.mark.parametrize("name", EFFECTS)
def test_agreement(name: str) -> None:
    machine = with_effects(EFFECTS[name])
    position, wrench = draw(machine, 40, seed=21)
    found = gap(machine, position, wrench)
    assert found.statuses == 0
    assert found.poses == 40
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("name", EFFECTS)
def test_the_effect_is_not_ignored(name: str) -> None:
    machine = with_effects(EFFECTS[name])
    position, wrench = draw(machine, 10, seed=22)
    plain = sm.load_machine("orthoglide-revised").solve(position, wrench).displacement
    changed = machine.solve(position, wrench).displacement
    assert np.abs(changed - plain).max() > 1e-6 * np.abs(plain).max()


@pytest.mark.parametrize("effects", [[], EFFECTS["dead_zone"]])
def test_displacements_alone_under_gravity(effects: list[Effect]) -> None:
    machine = with_effects(effects)
    position, wrench = draw(machine, 40, seed=23)
    options = {"gravity": (0.0, 0.0, -9.81), "stiffness": False}
    fast = machine.solve(position, wrench, **options)
    reference = machine.solve(position, wrench, method="reference", **options)
    np.testing.assert_array_equal(fast.status, reference.status)
    size = np.abs(reference.displacement).max(axis=1, keepdims=True)
    assert np.abs(fast.displacement - reference.displacement).max() < TOLERANCE * size.max()
    assert np.isnan(fast.stiffness).all()


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("linear-delta", ("joint_compliance", {"element": "rod", "translation": 1e-9, "rotation": 1e-7})),
        ("rotary-delta", ("joint_compliance", {"element": "rod", "translation": 1e-9, "rotation": 1e-7})),
        ("five-bar", ("hardening", {"element": "motor", "cubic": 1e13})),
        ("ur10", ("hardening", {"element": "elbow", "cubic": 1e13})),
        ("orthoglide-revised", ("joint_clearance", {"element": "bar", "radius": 1e-5})),
    ],
)
def test_soft_and_stiff_parts_stay_in_the_kernels(name: str, effect: Effect) -> None:
    machine = sm.load_machine(name).with_effect(effect[0], **effect[1])
    position, wrench = draw(machine, 40, seed=24)
    assert machine.solve(position, wrench).reference_share == 0
    found = gap(machine, position[:10], wrench[:10])
    assert found.statuses == 0
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("name", ["ur10", "rotary-delta"])
def test_the_slope_of_a_stiff_law_is_that_of_the_answer(name: str) -> None:
    machine = sm.load_machine(name)
    for drive in {"ur10": ("base", "shoulder", "elbow"), "rotary-delta": ("motor",)}[name]:
        machine = machine.with_effect("hardening", element=drive, cubic=1e13)
    found = gap(machine, *draw(machine, 24, seed=30))
    assert found.statuses == 0
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("gravity", [None, (0.0, 0.0, -9.81)])
def test_free_play_that_bears_nothing_is_singular(gravity: tuple[float, float, float] | None) -> None:
    machine = sm.load_machine("ur10")
    for drive in ("shoulder", "wrist_3"):
        machine = machine.with_effect("dead_zone", element=drive, half_width=5e-6)
    position, _ = draw(machine, 20, seed=25)
    force = np.array([30.0, 20.0, -40.0, 0.0, 0.0, 0.0])  # no moment about the last axis, but for round-off
    fast, reference = (
        machine.solve(position, force, method=m, gravity=gravity) for m in ("fast", "reference")
    )
    assert fast.reference_share == 0
    assert (fast.status == sm.Status.SINGULAR).all()
    np.testing.assert_array_equal(fast.flags, reference.flags)
    np.testing.assert_allclose(fast.displacement, reference.displacement, rtol=1e-10, atol=1e-14)
    assert np.isnan(fast.compliance).all()
    size = np.abs(reference.stiffness).max(axis=(1, 2), keepdims=True)
    assert np.abs((fast.stiffness - reference.stiffness) / size).max() < TOLERANCE
    # The last joint plays: a turn about the tool's axis, which the stiffness does not feel.
    twist, other = fast.free_twists[:, :, 0], reference.free_twists[:, :, 0]
    assert np.isnan(fast.free_twists[:, :, 1:]).all()
    np.testing.assert_allclose(np.abs(np.sum(twist * other, axis=1)), 1.0, atol=1e-12)
    assert np.abs(np.einsum("nij,nj->ni", fast.stiffness, twist) / size[:, :, 0]).max() < 1e-12


def test_a_joint_that_bears_through_its_gap_is_regular() -> None:
    machine = sm.load_machine("ur10").with_effect("dead_zone", element="wrist_3", half_width=5e-6)
    position, wrench = draw(machine, 24, seed=26)
    fast = machine.solve(position, wrench)
    assert fast.ok.all()
    assert (fast.flags & sm.Flag.FREE_PLAY == 0).all()
    found = gap(machine, position, wrench)
    assert found.statuses == 0
    assert found.worst() < TOLERANCE


def test_a_payload_on_an_arm() -> None:
    machine = sm.load_machine("ur10").with_effect("payload", mass=3.0, com_x=0.05, com_z=0.1)
    position, wrench = draw(machine, 24, seed=27)
    assert machine.solve(position, wrench).reference_share == 0
    found = gap(machine, position, wrench, gravity=(0.0, 0.0, -9.81))
    assert found.statuses == 0
    assert found.worst() < TOLERANCE


def test_gaps_that_bear_round_off_are_the_references() -> None:
    machine = sm.load_machine("hybrid")
    for drive in ("a", "b"):
        machine = machine.with_effect("dead_zone", element=drive, half_width=5e-6)
    position, wrench = draw(machine, 16, seed=442)
    wrench[::2] = 0.0
    options = {"gravity": (0.0, 0.0, -9.81)}
    fast, reference = (machine.solve(position, wrench, method=m, **options) for m in ("fast", "reference"))
    np.testing.assert_array_equal(fast.status, reference.status)


@pytest.mark.parametrize("name", ["orthoglide-revised", "ur10", "five-bar"])
@pytest.mark.parametrize("tension_only", ["no", "yes"])
def test_external_springs_at_the_tip(name: str, tension_only: str) -> None:
    machine = sm.load_machine(name)
    size = machine.compiled.length
    machine = machine.with_effect(
        "external_spring",
        stiffness=500.0,
        length=0.7 * size,
        anchor_x=0.3 * size,
        anchor_y=-0.2 * size,
        anchor_z=size,
        tension_only=tension_only,
    )
    assert machine.fast == ""
    position, wrench = draw(machine, 24, seed=26)
    wrench[::5] = 0.0
    assert machine.solve(position, wrench).reference_share < 0.1
    for options in ({}, {"gravity": (0.0, 0.0, -9.81)}):
        found = gap(machine, position, wrench, **options)
        assert found.statuses == 0
        assert found.poses > 20
        assert found.worst() < TOLERANCE


def test_an_external_spring_beside_the_tip() -> None:
    """At a point of the same body, the nose that carries a displaced tool."""
    machine = (
        sm.load_machine("travelling-column")
        .with_effect("tcp_offset", error_x=1e-3, error_z=2e-3)
        .with_effect(
            "external_spring",
            element="platform.spindle_nose",
            stiffness=2e4,
            length=0.3,
            anchor_x=0.1,
            anchor_y=0.2,
            anchor_z=2.5,
        )
    )
    assert machine.fast == ""
    position, wrench = draw(machine, 16, seed=28)
    found = gap(machine, position, wrench)
    assert found.statuses == 0
    assert found.worst() < TOLERANCE


def test_corner_after_corner() -> None:
    """Clearance of every pin: whole steps go to and fro on a fifth of the poses."""
    machine = sm.load_machine("swing-table")
    pins = {name.split(".")[1] for name in machine.compiled.names.coordinates if ".pin" in name}
    for pin in sorted(pins):
        machine = machine.with_effect("joint_clearance", element=pin, radius=5e-6)
    position, _ = draw(machine, 64, seed=29)
    wrench = [100.0, 50.0, -200.0, 0.0, 0.0, 0.0]
    assert machine.solve(position, wrench).reference_share < 0.05
    found = gap(machine, position[:16], np.tile(wrench, (16, 1)))
    assert found.statuses == 0
    assert found.worst() < TOLERANCE

"""Reading points elsewhere and several loads in the kernels (docs/fast_path.md F20), against the reference path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import (
    LOADS,
    TOLERANCE,
    compare,
    draw,
    pointed,
    reading_gap,
    several,
)

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.description import Point

ANCHOR = {"anchor_x": 0.1, "anchor_y": -0.2, "anchor_z": 2.0}
GRAVITY = (3.0, -4.0, -9.0)
CASES = range(5)


def agrees(machine: sm.Machine, position: np.ndarray, wrench: np.ndarray, **options: object) -> int:
    """Poses compared: all statuses equal, all numbers within the tolerance."""
    fast = machine.solve(position, wrench, threads=1, **options)
    reference = machine.solve(position, wrench, method="reference", threads=1, **options)
    found = compare(fast, reference)
    assert found.statuses == 0
    assert found.worst() < TOLERANCE
    assert reading_gap(fast, reference) < TOLERANCE
    ok = fast.ok
    size = np.nanmax(np.abs(reference.leg_wrench[ok]), initial=1e-300)
    assert np.nanmax(np.abs(fast.leg_wrench - reference.leg_wrench)[ok], initial=0.0) < 1e-8 * size
    return found.poses


@pytest.mark.parametrize("name", LOADS)
def test_every_machine(name: str) -> None:
    machine = pointed(sm.load_machine(name))
    position, wrench = draw(machine, 10, seed=41)
    wrench[0] = 0.0
    for case in CASES:
        options = several(wrench, case, machine)
        for gravity in (None, GRAVITY):
            assert agrees(machine, position, wrench, gravity=gravity, **options) > 5
            answer = machine.solve(position, wrench, gravity=gravity, **options)
            assert answer.reference_share == 0


@pytest.mark.parametrize("name", LOADS)
def test_beyond_the_box(name: str) -> None:
    machine = pointed(sm.load_machine(name))
    position, wrench = draw(machine, 24, seed=42, margin=-0.5)
    for case in (0, 3):
        assert agrees(machine, position, wrench, **several(wrench, case, machine)) > 2


@pytest.mark.parametrize("level", _core.kernel_levels())
@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "hybrid", "ur10", "five-bar"])
def test_every_level(name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFMAP_ISA", level)
    machine = pointed(sm.load_machine(name))
    position, wrench = draw(machine, 9, seed=43)
    for case in CASES:
        assert agrees(machine, position, wrench, **several(wrench, case, machine)) > 5


@pytest.mark.parametrize(
    ("name", "effect", "values"),
    [
        ("orthoglide-revised", "dead_zone", {"element": "actuator", "legs": ["y"], "half_width": 12e-6}),
        ("orthoglide-revised", "hardening", {"element": "actuator", "cubic": 1e13}),
        ("orthoglide-revised", "base_compliance", {"element": "base", "translation": 1e-7}),
        ("orthoglide-revised", "tool_compliance", {"element": "platform", "translation": 1e-7}),
        ("linear-delta", "friction", {"element": "carriage", "force": 3.0}),
        ("ur10", "dead_zone", {"element": "elbow", "half_width": 1e-4}),
        ("ur10", "external_spring", {"element": "tcp", "stiffness": 1e4, **ANCHOR}),
        ("hexapod", "external_spring", {"element": "platform.probe", "stiffness": 1e5, **ANCHOR}),
    ],
)
def test_with_effects(name: str, effect: str, values: dict[str, object]) -> None:
    machine = pointed(sm.load_machine(name)).with_effect(effect, **values)
    position, wrench = draw(machine, 8, seed=44)
    for case in CASES:
        assert agrees(machine, position, wrench, **several(wrench, case, machine)) > 3


@pytest.mark.parametrize("name", ["linear-delta", "ur10"])
def test_stiffness_by_central_differences(name: str) -> None:
    """Of the wrench at the point, the other loads as they are: the tool turns far enough that their arms matter."""
    machine = pointed(sm.load_machine(name))
    position, wrench = draw(machine, 1, seed=45)
    options = several(20 * wrench if name == "ur10" else wrench, 3, machine)
    base = machine.solve(position[0], wrench[0], **options)
    compliance = np.empty((6, 6))
    force, moment = LOADS[name]
    for i, step in enumerate([1e-3 * force] * 3 + [1e-3 * moment] * 3):
        h = step * np.eye(6)[i]
        ends = [machine.solve(position[0], wrench[0] + s * h, **options) for s in (-2, -1, 1, 2)]
        a, b, c, d = (np.asarray(e.readings)[..., 0, :] for e in ends)
        compliance[:, i] = (a - 8 * b + 8 * c - d).ravel() / (12 * step)
    # Rotation vectors add to first order only: compared is the linear part.
    size = np.abs(base.compliance.reshape(6, 6)[:3]).max(axis=0)
    assert np.abs(compliance - base.compliance.reshape(6, 6))[:3].max(axis=0) == pytest.approx(
        0, abs=1e-6 * size.min()
    )


def test_dead_forces_at_two_points_are_one_wrench_while_nothing_turns() -> None:
    """A closed form: the sum of both forces and their moment, in the limit of small loads."""
    machine = pointed(sm.load_machine("hexapod"))
    position, _ = draw(machine, 5, seed=46)
    f = np.array([1e-3, -2e-3, 3e-3])
    arm = np.array([0.03, 0.05, -0.12])
    both = machine.solve(position, np.r_[f, 0, 0, 0], wrenches={"platform.probe": np.r_[2 * f, 0, 0, 0]})
    one = machine.solve(position, np.r_[3 * f, np.cross(arm, 2 * f)])
    np.testing.assert_allclose(both.displacement, one.displacement, rtol=1e-6, atol=1e-18)


@pytest.mark.parametrize("name", ["hexapod", "ur10"])
def test_derivatives(name: str) -> None:
    """Variants (F10) see all loads: against differences of whole machines, solved by the reference path."""
    machine = pointed(sm.load_machine(name))
    position, wrench = draw(machine, 3, seed=47)
    options = several(wrench, 3, machine)
    place, h = {"ur10": "elbow", "hexapod": "strut"}[name], 1e-3
    request = [("compliance", {"element": place, "scale": 1.5})]
    answer = machine.solve(position, wrench, derivatives=request, **options)
    assert answer.reference_share == 0

    def at(scale: float) -> np.ndarray:
        changed = machine.with_effect("compliance", element=place, scale=scale)
        return changed.solve(position, wrench, method="reference", **options).displacement

    true = (at(1.5 + h) - at(1.5 - h)) / (2 * h)
    (slope,) = answer.derivatives.values()
    assert np.abs(true).max() > 0
    assert np.abs(slope - true).max() < 1e-5 * np.abs(true).max()


def test_a_point_behind_a_transform_with_an_error() -> None:
    """Nominal and actual geometry differ between the tip and the point that is read and loaded."""
    from stiffmap.model.description import Offset, Pose

    machine = sm.load_machine("orthoglide-revised")
    d = machine.description
    angle = 2e-3
    turn = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    home = Pose.of(d.home.p + [0.0, 0.0, 0.04], d.home.r)
    tilt = Offset("adapter", Pose.of((0.0, 0.0, 0.04)), Pose.of((1e-4, 2e-4, 0.0401), turn))
    moved = sm.Machine(replace(d, home=home, platform=(Point("flange", (0.02, 0.0, 0.0)), tilt, *d.platform)))
    position, wrench = draw(moved, 8, seed=48)
    position = position + [0.0, 0.0, 0.04]
    for options in (
        {"read_points": ["platform.flange"]},
        {"point": "platform.flange", "read_points": ["tcp"]},
        {"wrenches": {"platform.flange": wrench[::-1]}, "load_type": {"platform.flange": "follower"}},
        {"point": "platform.flange", "load_type": "semitangential"},
    ):
        assert agrees(moved, position, wrench, **options) > 5
        assert moved.solve(position, wrench, **options).reference_share == 0


def test_one_pose_reads_as_many() -> None:
    """The answer of a pose does not depend on its neighbours, nor the first reading on the others."""
    machine = pointed(sm.load_machine("linear-delta"))
    position, wrench = draw(machine, 9, seed=49)
    every = list(machine.points)
    many = machine.solve(position, wrench, read_points=every)
    plain = machine.solve(position, wrench)
    np.testing.assert_array_equal(many.displacement, plain.displacement)
    np.testing.assert_array_equal(many.stiffness, plain.stiffness)
    for i in range(len(position)):
        one = machine.solve(position[i], wrench[i], read_points=every)
        np.testing.assert_array_equal(one.readings, many.readings[i])


@pytest.mark.parametrize("name", ["orthoglide-revised", "ur10"])
def test_what_the_reference_still_takes(name: str) -> None:
    """A load on another body: said, and answered."""
    machine = pointed(sm.load_machine(name))
    position, wrench = draw(machine, 4, seed=50)
    middle = next(p for p in machine.points if p.endswith("middle"))
    answer = machine.solve(position, wrench, wrenches={middle: 0.1 * wrench})
    assert answer.reference_share == 1
    assert answer.ok.any()

"""Where the kernels save linearisations they agree with the reference path all the same."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import TOLERANCE, compare, draw

import stiffmap as sm
from stiffmap.model.effects import get


def agree(machine: sm.Machine, position: np.ndarray, wrench: np.ndarray) -> sm.Solution:
    """The kernels' answer, found to be the reference's."""
    fast = machine.solve(position, wrench)
    found = compare(fast, machine.solve(position, wrench, method="reference"))
    assert found.statuses == 0
    assert found.worst() < TOLERANCE
    return fast


@pytest.mark.parametrize("times", [0.0, 1e-3, 20.0, 60.0, 200.0])
def test_an_arm_knows_its_load_at_once(times: float) -> None:
    machine = sm.load_machine("ur10")
    position, wrench = draw(machine, 20, seed=81)
    fast = agree(machine, position, times * wrench)
    assert fast.reference_share == 0
    if times < 1:
        assert fast.iterations.max() <= 3


def test_friction_of_an_arm_has_the_signs_of_linear_statics() -> None:
    machine = sm.load_machine("ur10")
    for name in ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"):
        machine = machine.with_effect("friction", element=name, torque=2.0, branch="loading")
    position, wrench = draw(machine, 16, seed=3358)
    agree(machine, position, wrench)


@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "rotary-delta", "five-bar"])
def test_a_step_with_the_same_factors(name: str) -> None:
    machine = sm.load_machine(name)
    position, wrench = draw(machine, 24, seed=82)
    fast = agree(machine, position, wrench)
    assert fast.iterations.max() <= 5


@pytest.mark.parametrize("radius", [2e-6, 2e-5])
def test_gaps_of_every_pin(radius: float) -> None:
    machine = sm.load_machine("swing-table")
    for element, legs in places(machine, "joint_clearance"):
        machine = machine.with_effect("joint_clearance", element=element, legs=legs, radius=radius)
    position, _ = draw(machine, 24, seed=83)
    fast = agree(machine, position, np.broadcast_to((100.0, 50.0, -200.0, 0.0, 0.0, 0.0), (24, 6)).copy())
    assert fast.reference_share < 0.1


def places(machine: sm.Machine, kind: str) -> list[tuple[str, list[str]]]:
    """Each element that takes the effect, with all its legs."""
    out: dict[str, list[str]] = {}
    for element, legs in get(kind).places(machine.description):
        if len(legs) >= len(out.get(element, [])):
            out[element] = list(legs)
    return list(out.items())

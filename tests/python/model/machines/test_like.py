"""A machine made like another takes over what was found out about its home: the numbers are the same to the last bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Pose
from stiffmap.model.description.tree import joints

GRAVITY = (0.0, 0.0, -9.81)


def same_bits(a: sm.Machine, b: sm.Machine) -> None:
    low, high = a.workspace
    at = np.random.default_rng(5).uniform(low, high, (20, 3))
    load = np.tile([100.0, 50.0, -200.0, 0.0, 0.0, 0.0], (20, 1))
    one, other = (m.solve(at, load, gravity=GRAVITY) for m in (a, b))
    for name in ("status", "flags", "coordinates", "displacement", "compliance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize("name", sm.machine_names())
def test_with_another_spring_and_another_error(name: str) -> None:
    machine = sm.load_machine(name)
    drive = machine.actuators[0].split(".")[-1]
    softer = machine.with_effect("tcp_offset", error_x=1e-4).with_effect(
        "zero_offset", element=drive, error=1e-5
    )
    same_bits(softer, sm.Machine(softer.description))


@pytest.mark.parametrize("name", ["hexapod", "rotary-delta", "orthoglide-revised"])
def test_another_geometry_is_no_likeness(name: str) -> None:
    machine = sm.load_machine(name)
    d = machine.description
    moved = replace(d, home=Pose.of(d.home.p + [0.0, 0.0, 1e-3], d.home.r))
    assert joints(moved).keys() == joints(d).keys()
    same_bits(sm.Machine(moved, like=machine), sm.Machine(moved))

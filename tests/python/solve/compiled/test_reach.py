"""The certain no for poses beyond a leg's length is right: the reference path finds them out of reach too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.oracle.classes import Classes
from tests.oracle.generate import Generator

import stiffmap as sm
from stiffmap.model.description import MachineDescription


@pytest.mark.parametrize(
    "name",
    ["linear-delta", "rotary-delta", "orthoglide-revised", "hexapod", "tripteron", "travelling-column"],
)
def test_same_answer_far_outside(name: str) -> None:
    machine = sm.load_machine(name)
    low, high = machine.workspace
    far = np.random.default_rng(51).uniform(-1, 1, (30, 3))
    position = (low + high) / 2 + 1.5 * (high - low) * far
    fast = machine.solve(position, stiffness=False)
    reference = machine.solve(position, method="reference", stiffness=False)
    unreachable = sm.Status.UNREACHABLE
    np.testing.assert_array_equal(fast.status == unreachable, reference.status == unreachable)
    if name == "travelling-column":  # a ram that is not there
        assert fast.reference_share == 0
        np.testing.assert_array_equal(fast.flags, reference.flags)
    if name in ("linear-delta", "travelling-column"):
        assert (fast.status == unreachable).sum() >= 5


def test_a_box_mostly_out_of_reach_changes_no_answer() -> None:
    # its starts are not searched to the end (closure_grid.cpp); a slip of the sign makes such a box
    machine = sm.load_machine("rotary-delta")
    low, high = machine.workspace
    slipped = sm.Machine(replace(machine.description, workspace=(tuple(low), (*high[:2], -high[2]))))
    position = np.random.default_rng(5).uniform(low, high, (200, 3))
    load = [100.0, 50, -200, 0, 0, 0]
    expected, found = machine.solve(position, load), slipped.solve(position, load)
    np.testing.assert_array_equal(found.status, expected.status)
    np.testing.assert_allclose(found.displacement, expected.displacement, rtol=0, atol=1e-12)


@pytest.mark.parametrize("make", [lambda: Generator(80).machine(), lambda: Generator(146).machine(), lambda: Classes(27).task().description])  # fmt: skip
def test_general_arms_and_machines_closed_as_a_whole_say_so_in_lanes(
    make: Callable[[], MachineDescription],
) -> None:
    description = make()
    home = description.home.p
    box = (tuple((home - 0.1).tolist()), tuple((home + 0.1).tolist()))
    machine = sm.Machine(replace(description, workspace=box))
    position = home + np.random.default_rng(7).uniform(-0.4, 0.4, (60, 3))
    fast, reference = (
        machine.solve(position, stiffness=False, method=method) for method in ("fast", "reference")
    )
    lost = fast.status == sm.Status.UNREACHABLE
    assert 10 < lost.sum() < 55
    assert (reference.status[lost] == sm.Status.UNREACHABLE).all()  # some others only the lanes reach
    assert fast.reference_share < 0.15

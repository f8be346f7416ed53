"""The certain no for poses beyond a leg's length is right: the reference path finds them out of reach too."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm


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

"""One rotation or wrench for all poses is the same as one for each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Point

FORCE = np.array([100.0, 50.0, -200.0, 1.0, -2.0, 3.0])
ELSEWHERE = "platform.mark"


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("name", ["orthoglide-revised", "ur10", "five-bar"])
@pytest.mark.parametrize("kind", ["dead", "follower"])
def test_one_for_all(name: str, method: str, kind: str) -> None:
    machine = marked(name)
    low, high = machine.workspace
    poses = np.random.default_rng(5).uniform(low, high, (11, 3))
    turned = machine.compiled.home_rotation
    for further in ({}, {ELSEWHERE: 0.5 * FORCE}):
        options = {"method": method, "load_type": kind, "read_points": [ELSEWHERE]}
        one = machine.solve(poses, FORCE, rotation=turned, wrenches=further, **options)
        each = machine.solve(
            poses,
            np.tile(FORCE, (11, 1)),
            rotation=np.tile(turned, (11, 1, 1)),
            wrenches={n: np.tile(w, (11, 1)) for n, w in further.items()},
            **options,
        )
        assert one.ok.all()
        for field in (
            "displacement",
            "readings",
            "stiffness",
            "compliance",
            "status",
            "flags",
            "coordinates",
        ):
            np.testing.assert_array_equal(getattr(one, field), getattr(each, field))


def test_one_for_none() -> None:
    """No pose at all, and a load for each of one rotation's poses."""
    machine = sm.load_machine("ur10")
    assert machine.solve(np.zeros((0, 3)), FORCE).status.shape == (0,)
    poses = np.mean(machine.workspace, axis=0) + np.zeros((4, 1, 3))
    loads = FORCE * np.linspace(0.0, 1.0, 5)[:, None]
    found = machine.solve(poses, loads)
    assert found.status.shape == (4, 5)
    np.testing.assert_array_equal(found.displacement[2], machine.solve(poses[2, 0], loads).displacement)


def marked(name: str) -> sm.Machine:
    """With a second point on the platform."""
    machine = sm.load_machine(name)
    d = machine.description
    return sm.Machine(replace(d, platform=(*d.platform, Point("mark", (0.03, -0.02, 0.05)))))

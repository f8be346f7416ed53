"""External springs at the tip, also under gravity: solved in the kernels as the reference path does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import TOLERANCE, compare, draw

import stiffmap as sm
from stiffmap.model.description import ExternalSpring, Point
from stiffmap.model.effects.library.loads import DOWN

GRAVITY = (0.0, 0.0, -9.81)


def pulled(name: str) -> sm.Machine:
    """A machine with two springs from its tip to the base, one of which only pulls."""
    machine = sm.load_machine(name)
    home = np.asarray(machine.description.home.translation)
    points = (Point("left", (0.02, 0.01, 0.0)), Point("right", (-0.01, 0.0, 0.03)))

    def spring(point: str, way: tuple[float, float, float], tension_only: bool) -> ExternalSpring:
        anchor = home + np.array(way)
        return ExternalSpring(
            f"to_{point}",
            f"platform.{point}",
            tuple(map(float, anchor)),
            30.0,
            0.1,
            tension_only=tension_only,
        )

    return sm.Machine(
        replace(
            machine.description,
            platform=(*machine.description.platform, *points),
            external_springs=(
                spring("left", (0.3, 0.1, -0.4), False),
                spring("right", (-0.2, 0.3, -0.3), True),
            ),
        )
    )


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), GRAVITY], ids=["weightless", "heavy"])
@pytest.mark.parametrize("name", ["linear-delta", "rotary-delta", "hexapod", "hybrid", "ur10", "five-bar"])
def test_agreement(name: str, gravity: tuple[float, float, float]) -> None:
    machine = pulled(name)
    position, wrench = draw(machine, 12, seed=71)
    fast = machine.solve(position, wrench, gravity=gravity)
    assert fast.reference_share == 0
    found = compare(fast, machine.solve(position, wrench, gravity=gravity, method="reference"))
    assert found.statuses == 0
    assert found.poses == 12
    assert found.worst() < TOLERANCE


def test_a_payload_is_the_weight_that_it_stands_for() -> None:
    machine = sm.load_machine("linear-delta")
    position = draw(machine, 12, seed=72)[0]
    carried = machine.with_effect("payload", mass=2.0).solve(position, gravity=GRAVITY)
    pressed = machine.solve(position, (0.0, 0.0, 2.0 * DOWN[2], 0.0, 0.0, 0.0), gravity=GRAVITY)
    assert carried.reference_share == 0
    np.testing.assert_allclose(carried.displacement, pressed.displacement, rtol=1e-6, atol=1e-12)

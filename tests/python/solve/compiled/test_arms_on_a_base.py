"""Arms whose base yields, under gravity: the weights of the six joints that are taken together turn with their start
(docs/fast_path.md F12)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.solve.compiled.agreement import TOLERANCE, compare, draw

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.description import (
    Body,
    Element,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Pose,
    Spring,
)

GRAVITY = (1.0, 2.0, -9.81)
SOFT = {"translation": 1e-6, "rotation": 1e-5, "pivot_x": 0.3}


def matrix(diagonal: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in np.diag(diagonal))


def gantry() -> sm.Machine:
    """Three slides and a wrist with bodies on all of them, on a soft foundation and with a soft tool."""
    rng = np.random.default_rng(5)
    elements: list[Element] = [Body("column", 60.0, (0.2, 0.1, 0.5))]
    end = np.zeros(3)
    for i, (kind, axis) in enumerate(zip(["prismatic"] * 3 + ["revolute"] * 3, "xyzzxy", strict=True)):
        direction = tuple(float(axis == a) for a in "xyz")
        law = Law(3e5 if kind == "prismatic" else 2e4)
        elements.append(Joint(f"joint_{i}", kind, (direction,), home=(0.0,), actuated=True, law=law))
        elements.append(Body(f"body_{i}", 20.0 / (i + 1), tuple(float(v) for v in rng.uniform(-0.3, 0.3, 3))))
        step = rng.uniform(-0.3, 0.3, 3)
        end += step
        elements.append(Offset(f"link_{i}", Pose.of(step)))
    elements.append(Spring("tool", stiffness=matrix((1e6, 2e6, 3e6, 1e4, 2e4, 3e4))))
    elements.append(Body("tip", 4.0, (0.0, 0.1, -0.1)))
    foundation = Spring("foundation", stiffness=matrix((4e5, 3e5, 5e5, 3e4, 2e4, 4e4)))
    legs = (Leg("arm", tuple(elements)),)
    return sm.Machine(replace(MachineDescription("gantry", legs, home=Pose.of(end)), base=(foundation,)))


def cases() -> dict[str, tuple[sm.Machine, np.ndarray, np.ndarray]]:
    """Machine, positions (n, 3) m, wrenches (n, 6)."""
    arm = sm.load_machine("ur10").with_effect("base_compliance", **SOFT)
    position, wrench = draw(arm, 12, seed=4)
    slides = gantry()
    at = np.asarray(slides.description.home.translation) + np.random.default_rng(2).uniform(
        -0.1, 0.1, (12, 3)
    )
    return {
        "ur10": (arm, position, wrench),
        "with a payload": (
            arm.with_effect("payload", mass=5.0, com_x=0.1, com_z=-0.1),
            position,
            wrench,
        ),
        "gantry": (slides, at, 4 * wrench),
    }


@pytest.mark.parametrize("case", ["ur10", "with a payload", "gantry"])
@pytest.mark.parametrize("kind", ["dead", "follower", "semitangential"])
def test_stiffness_of_an_arm_on_a_soft_base(case: str, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    machine, position, wrench = cases()[case]
    expected = machine.solve(position, wrench, gravity=GRAVITY, load_type=kind, method="reference")
    for level in _core.kernel_levels():
        monkeypatch.setenv("STIFFMAP_ISA", level)
        found = machine.solve(position, wrench, gravity=GRAVITY, load_type=kind)
        assert found.reference_share == 0
        gap = compare(found, expected)
        assert gap.statuses == 0 and gap.poses == 12
        assert gap.worst() < TOLERANCE


@pytest.mark.parametrize("case", ["ur10", "gantry"])
def test_compliance_is_the_slope_of_the_displacement(case: str) -> None:
    """Central differences, whose errors are of the square of the step."""
    machine, position, wrench = cases()[case]
    at = machine.solve(position[:3], wrench[:3], gravity=GRAVITY)
    size = np.sqrt(np.diagonal(at.compliance, axis1=1, axis2=2))
    worst = []
    for step in (0.4, 0.2):
        found = np.empty_like(at.compliance)
        for i, unit in enumerate(np.diag([500.0] * 3 + [100.0] * 3) * step):
            up, down = (machine.solve(position[:3], wrench[:3] + s * unit, gravity=GRAVITY) for s in (1, -1))
            found[:, :3, i] = (up.displacement - down.displacement)[:, :3] / (2 * unit[i])
            turn = (
                Rotation.from_rotvec(up.displacement[:, 3:])
                * Rotation.from_rotvec(down.displacement[:, 3:]).inv()
            )
            found[:, 3:, i] = turn.as_rotvec() / (2 * unit[i])
        worst.append(np.abs((found - at.compliance) / (size[:, :, None] * size[:, None, :])).max())
    assert worst[1] < 1e-4
    assert worst[1] < 0.27 * worst[0]

"""The metrology loop and named points: what the instrument stands on, where force acts and reacts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment import Experiment, Loop, predict, random_plan
from stiffmap.experiment.calls import placed
from stiffmap.experiment.poses.configuration import point_positions
from stiffmap.model.description import Point

OFFSET = (0.01, 0.02, 0.03)


@pytest.fixture(scope="module")
def pointed(orthoglide: sm.Machine) -> sm.Machine:
    """A gauge on the foot of each leg, the end of each leg, and a probe below the platform."""
    d = orthoglide.description

    def marked(leg: Any) -> Any:
        at = [e.name for e in leg.elements].index("foot") + 1
        elements = (*leg.elements[:at], Point("gauge", OFFSET), *leg.elements[at:], Point("end"))
        return replace(leg, elements=elements)

    platform = (*d.platform, Point("probe", (0.0, 0.05, -0.12)))
    return sm.Machine(replace(d, legs=tuple(map(marked, d.legs)), platform=platform))


@pytest.fixture(scope="module")
def plan(pointed: sm.Machine) -> Experiment:
    return random_plan(pointed, "deflection", poses=5, loads=4, repeats=1, seed=3)


def linear(machine: sm.Machine, plan: Experiment, effect: str) -> float:
    """Largest change of a reading by an effect, m."""
    change = predict(machine, plan, (placed(machine, effect),)) - predict(machine, plan)
    return float(np.abs(change[:, :3]).max())


BASE = "base_compliance base translation=1e-7m/N"
HOLDER = "tool_compliance platform translation=1e-7m/N"


@pytest.mark.parametrize(
    ("effect", "loop", "seen"),
    [
        (BASE, Loop(), True),
        (BASE, Loop(instrument_on="base"), False),
        (BASE, Loop(force_against="base"), False),
        (BASE, Loop(target_on="platform"), True),
        (HOLDER, Loop(), True),
        (HOLDER, Loop(instrument_on="base"), True),
        (HOLDER, Loop(target_on="platform"), False),
    ],
)
def test_what_the_loop_shows(
    effect: str, loop: Loop, seen: bool, pointed: sm.Machine, plan: Experiment
) -> None:
    change = linear(pointed, replace(plan, loop=loop), effect)
    assert change == pytest.approx(4e-5, rel=1e-3) if seen else change < 1e-9


def test_on_the_platform_nothing_moves(pointed: sm.Machine, plan: Experiment) -> None:
    """Instrument and target on one rigid body."""
    still = predict(pointed, replace(plan, loop=Loop(instrument_on="platform.probe")))
    assert np.abs(predict(pointed, plan)[:, :3]).max() > 1e-4
    assert np.abs(still).max() < 1e-15


def test_seen_from_a_foot(pointed: sm.Machine, plan: Experiment) -> None:
    """By the distance to the gauge, which no frame changes, and by the turn between the bodies."""
    s = pointed.solve(plan.position, plan.wrench, read_points=["x.gauge"])
    arm = plan.position - point_positions(pointed, "x.gauge", plan)
    true = arm + s.readings[:, 0, :3] - s.readings[:, 1, :3]
    seen = predict(pointed, replace(plan, loop=Loop(instrument_on="x.gauge")))
    np.testing.assert_allclose(
        np.linalg.norm(arm + seen[:, :3], axis=1), np.linalg.norm(true, axis=1), rtol=0, atol=1e-14
    )
    turned = Rotation.from_rotvec(s.readings[:, 1, 3:]) * Rotation.from_rotvec(seen[:, 3:])
    np.testing.assert_allclose(turned.as_rotvec(), s.readings[:, 0, 3:], atol=1e-14)


def test_a_force_within_one_body_does_nothing(pointed: sm.Machine, plan: Experiment) -> None:
    assert np.abs(predict(pointed, replace(plan, loop=Loop(force_against="platform.probe")))).max() < 1e-8


def test_a_force_against_a_foot(pointed: sm.Machine, plan: Experiment) -> None:
    got = predict(pointed, replace(plan, loop=Loop(force_against="y.gauge")))
    arm = plan.position - point_positions(pointed, "y.gauge", plan)
    back = -np.hstack([plan.wrench[:, :3], np.cross(arm, plan.wrench[:, :3])])
    both = pointed.solve(plan.position, plan.wrench, wrenches={"y.gauge": back})
    np.testing.assert_allclose(got, both.displacement, atol=1e-12)


def test_where_points_are(pointed: sm.Machine, plan: Experiment) -> None:
    q = sm.inverse_kinematics(pointed, plan.position).actuators
    for i, leg in enumerate("xyz"):
        carried = np.roll(OFFSET, i) + q[:, [i]] * np.eye(3)[i]
        np.testing.assert_allclose(point_positions(pointed, f"{leg}.gauge", plan), carried)
        end = point_positions(pointed, f"{leg}.end", plan)
        np.testing.assert_allclose(end, plan.position, atol=1e-12)  # the leg closes at the TCP
    probe = point_positions(pointed, "platform.probe", plan)
    np.testing.assert_allclose(probe, plan.position + [0.0, 0.05, -0.12], atol=1e-12)


def test_points_may_change_from_row_to_row(pointed: sm.Machine, plan: Experiment) -> None:
    points = tuple(("tcp", "platform.probe", "z.gauge")[i % 3] for i in range(len(plan)))
    loads = tuple(("platform.probe", "tcp")[i % 2] for i in range(len(plan)))
    got = predict(pointed, replace(plan, points=points, load_points=loads))
    for i in range(len(plan)):
        alone = pointed.solve(
            plan.position[i], plan.wrench[i], point=loads[i], read_points=[points[i]]
        ).readings[1]
        np.testing.assert_allclose(got[i], alone, atol=1e-12)


def test_what_cannot_be_seen_is_said(pointed: sm.Machine, plan: Experiment) -> None:
    from stiffmap.experiment import residual, simulate

    twin = simulate(pointed, replace(plan, loop=Loop("base", "platform", "floor")), seed=1)
    told = " ".join(residual(pointed, twin).limitations)
    assert "the base's compliance cannot be seen" in told
    assert "the tool holder's compliance cannot be seen" in told

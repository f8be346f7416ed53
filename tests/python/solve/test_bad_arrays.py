"""Array calls: bad input is one clear sentence, a bad pose is a status."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

import stiffmap as sm

BAD = [
    (
        {"position": (0.0, 0.0)},
        r"position: expected positions \(m\) of shape \(\.\.\., 3\), got shape \(2,\)",
    ),
    ({"position": "here"}, "position: expected positions"),
    ({"wrench": (1.0, 2.0, 3.0)}, r"wrench: expected 6 numbers .* got 3; append the moment"),
    ({"wrench": np.ones(5)}, r"wrench: expected wrenches .* got shape \(5,\)"),
    ({"wrench": (1, 2, 3, 4, 5, np.nan)}, "wrench: expected finite numbers, got 1"),
    (
        {"position": np.zeros((4, 3)), "wrench": np.zeros((5, 6))},
        r"do not broadcast together: \(4,\), \(5,\)",
    ),
    ({"rotation": np.ones((3, 3))}, "rotation: expected rotation matrices"),
    ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation: expected rotation matrices"),
    ({"rotation": np.eye(2)}, r"rotation: .* \(2, 2\)"),
    ({"point": "nose"}, "point: expected one of tcp.*got 'nose'"),
    ({"wrenches": {"nose": np.zeros(6)}}, "point: expected one of tcp.*got 'nose'"),
    ({"read_points": ("nose",)}, "point: expected one of tcp.*got 'nose'"),
    ({"load_type": "lively"}, "load_type: expected one of dead, follower, semitangential, got 'lively'"),
    ({"method": "quick"}, "method: expected one of fast, reference, got 'quick'"),
    ({"gravity": 9.81}, "gravity: expected 3 finite numbers"),
    ({"gravity": (0, 0, np.inf)}, "gravity: expected 3 finite numbers"),
    ({"load_steps": 0}, "load_steps: expected 'auto' or a positive number, got 0"),
    ({"load_steps": "many"}, "load_steps: expected 'auto'"),
    ({"threads": 0}, "threads: expected 1 or more, got 0"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=lambda v: str(v)[:40])
def test_one_clear_error(orthoglide: sm.Machine, arguments: dict[str, object], message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message) as caught:
        orthoglide.solve(**{"position": (0.0, 0.0, 0.0), **arguments})  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_a_bad_pose_is_unreachable_among_good_ones(orthoglide: sm.Machine, method: str, bad: float) -> None:
    position = np.zeros((3, 3))
    position[1, 2] = bad
    said = (
        nullcontext()
        if np.isfinite(bad)
        else pytest.warns(UserWarning, match="1 of 3 positions are not finite")
    )
    with said:
        s = orthoglide.solve(position, (300.0, 0, 0, 0, 0, 0), method=method)
    assert s.status.tolist() == [sm.Status.CONVERGED, sm.Status.UNREACHABLE, sm.Status.CONVERGED]
    for values in (s.displacement, s.stiffness, s.compliance, s.leg_wrench, s.actuator_effort, s.coordinates):
        assert np.isnan(values[1]).all() and np.isfinite(values[[0, 2]]).all()


def test_a_turned_platform_that_cannot_turn_is_unreachable(orthoglide: sm.Machine) -> None:
    c, s = np.cos(0.1), np.sin(0.1)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert orthoglide.solve((0, 0, 0), rotation=turned).status == sm.Status.UNREACHABLE


def test_shapes_broadcast(orthoglide: sm.Machine) -> None:
    s = orthoglide.solve(np.zeros((4, 1, 3)), np.zeros((5, 6)))
    assert s.displacement.shape == (4, 5, 6)
    assert s.stiffness.shape == s.compliance.shape == s.free_twists.shape == (4, 5, 6, 6)
    assert s.status.shape == s.flags.shape == s.iterations.shape == (4, 5)
    assert s.leg_wrench.shape == (4, 5, 3, 6) and s.actuator_effort.shape == (4, 5, 3)
    assert s.spring_deflection["x.foot"].shape == (4, 5, 6)
    assert s.joint_coordinates["x.actuator"].shape == (4, 5)
    for values in (s.displacement, s.stiffness):
        assert values.dtype == np.float64 and values.flags.c_contiguous
    assert s.status.dtype == np.uint8


def test_no_poses_is_an_empty_answer(orthoglide: sm.Machine) -> None:
    s = orthoglide.solve(np.zeros((0, 3)), (1.0, 0, 0, 0, 0, 0))
    assert s.displacement.shape == (0, 6) and s.status.shape == (0,)

"""Which readings are compared, and in which order places have their names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.identification.inference.columns import drawn, repeated


@pytest.mark.parametrize(
    ("pose", "most", "number"), [(np.arange(40) // 4, 40, 40), (np.arange(80) // 4, 50, 48)]
)
def test_whole_poses_are_drawn(pose: np.ndarray, most: int, number: int) -> None:
    found = drawn(pose, 0, most)
    assert len(found) == number and all(np.sum(pose[found] == k) == 4 for k in np.unique(pose[found]))
    assert np.array_equal(found, drawn(pose, 0, most))


def test_of_one_pose_with_too_many_readings_evenly_many_are_taken() -> None:
    found = drawn(np.zeros(10_000, dtype=np.intp), 0, 600)
    assert len(found) == 600 and found[0] == 0 and found[-1] == 9999
    assert np.ptp(np.diff(found)) <= 1


def test_of_few_poses_with_many_readings_each_all_are_kept() -> None:
    pose = np.arange(2112) // 264
    found = drawn(pose, 0, 600)
    assert len(found) == 600 and np.array_equal(np.bincount(pose[found]), np.full(8, 75))


def test_repeats_that_are_rounded_to_the_same_number_say_nothing_of_the_noise() -> None:
    """Of four conditions read twice and one read once."""
    mean = np.kron(np.eye(4), np.full((2, 1), 0.5**0.5))
    mean = np.block([[mean, np.zeros((8, 1))], [np.zeros((1, 4)), np.ones((1, 1))]])
    apart = np.array([0.5, -0.5])
    assert repeated(np.append(np.kron([0, 0, 0, 1], apart), 0.0), mean) == (0.0, 0.0)
    assert repeated(np.append(np.kron([0, 2, 1, 1], apart), 0.0), mean) == (3.0, 4.0)
    assert repeated(np.zeros(4), np.eye(4)) == (0.0, 0.0)


@pytest.mark.parametrize("question", [sm.diagnose, sm.calibrate])
@pytest.mark.parametrize(("poses", "angles"), [(3, False), (1, True)])
def test_readings_that_unknown_frames_take_up_are_refused(
    question: Callable[..., object], poses: int, angles: bool, tmp_path: Path
) -> None:
    drives = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
    lines = ["machine: ur10", "quantity: position", "units: {length: mm, angle: deg}", "frame: unknown"]
    lines += [f"tool: {'unknown' if angles else 'offset_unknown'}", "command:"]
    lines += [f"  {d}: {{actuator: arm.{d}, unit: deg}}" for d in drives]
    lines += ["noise: {dx: 0.03, dy: 0.03, dz: 0.03, rx: 0.01, ry: 0.01, rz: 0.01}"]
    (tmp_path / "experiment.yaml").write_text("\n".join(lines), encoding="utf-8")
    sees = ["px", "py", "pz"] + ["prx", "pry", "prz"] * angles
    rows = [
        [20 * k, -60 - 15 * k, 90, 25 * k, -90 + 30 * k, 5, 90 * k, 40 * k * k, 70] + [1, 2, 3] * angles
        for k in range(poses)
    ]
    table = [",".join(map(str, r)) for r in [[*drives, *sees], *rows]]
    (tmp_path / "data.csv").write_text("\n".join(table), encoding="utf-8")
    with pytest.raises(StiffmapError, match=r"take up all \d+ readings; read more poses"):
        question(sm.load_machine("ur10"), tmp_path)

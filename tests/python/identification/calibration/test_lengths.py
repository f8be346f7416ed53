"""Zeros of an arm from the lengths of a wire whose anchor, zero and place on the tool nobody knows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment
from stiffmap.experiment.noise.whitening import LinearProblem

JOINTS = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
NOISE = 5e-5


def measured(folder: Path, machine: sm.Machine, off: np.ndarray) -> Experiment:
    rng = np.random.default_rng(1)
    q = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-0.7, 0.7, (130, 6))
    there = sm.forward_kinematics(machine, q + off)
    at = there.position + there.rotation @ [0.03, -0.02, 0.08]
    length = np.linalg.norm(at - [1.2, -0.9, -0.3], axis=1) + 0.012 + NOISE * rng.standard_normal(len(q))
    command = "".join(f"  c{i}: {{actuator: arm.{j}, unit: rad}}\n" for i, j in enumerate(JOINTS))
    (folder / "experiment.yaml").write_text(
        "machine: ur10\nquantity: position\nunits: {length: m}\nnoise: {ll: 5e-5}\ntool: offset_unknown\n"
        f"command:\n{command}"
    )
    body = ([repr(float(v)) for v in row] for row in np.column_stack([q, length]))
    lines = [[*(f"c{i}" for i in range(6)), "length"], *body]
    (folder / "data.csv").write_text("\n".join(map(",".join, lines)) + "\n")
    return load_experiment(folder)


def unseen(machine: sm.Machine, e: Experiment) -> float:
    """m, rms per degree of freedom, anchor and tool point fitted."""
    p = Predictor(machine, e)
    problem = LinearProblem.of(p.experiment, p.experiment.sigma, p())
    left = problem.residual(p())
    return NOISE * float(np.sqrt(left @ left / problem.freedom))


@pytest.mark.parametrize("size", [1.0, 10.0])
def test_zeros_are_found_within_their_intervals(size: float, tmp_path: Path) -> None:
    machine = sm.load_machine("ur10")
    off = size * np.array([0.0, 0.002, -0.003, 0.0015, 0.0025, 0.0])
    e = measured(tmp_path, machine, off)
    seen = np.arange(len(e)) < 100
    c = sm.calibrate(machine, e.rows(seen))
    rows = {r.name: r for r in c.rows}
    for joint, error in zip(JOINTS[1:5], off[1:5], strict=True):
        found = rows[f"zero of arm.{joint}"]
        assert found.identifiable
        assert abs(found.value - error) < 2.5 * found.sigma, joint
        assert found.sigma < 2e-3
    assert unseen(machine, e.rows(~seen)) > 3.0 * NOISE
    assert unseen(c.machine, e.rows(~seen)) < 1.3 * NOISE

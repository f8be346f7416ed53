"""Commanded joints in any branch, redundant arms, rows out of reach: against transforms written out here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, load_experiment, random_plan, simulate
from stiffmap.experiment.virtual.plans import with_command
from stiffmap.model.description import AppliedEffect

DH = (
    (0.1273, 0.0, np.pi / 2),
    (0.0, -0.612, 0.0),
    (0.0, -0.5723, 0.0),
    (0.163941, 0.0, np.pi / 2),
    (0.1157, 0.0, -np.pi / 2),
    (0.0922, 0.0, 0.0),
)
ELBOW_DOWN = np.array([0.4, -0.3, -1.7, 0.5, 1.2, 0.3])


def ur10(q: np.ndarray) -> np.ndarray:
    """(4, 4) tool frame of a UR10, by its table of Denavit and Hartenberg."""
    out = np.eye(4)
    for angle, (d, a, alpha) in zip(q, DH, strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        step = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        out = out @ np.array(step)
    return out


def folder(place: Path, head: str, table: str) -> Path:
    place.mkdir(exist_ok=True)
    (place / "experiment.yaml").write_text(head)
    (place / "data.csv").write_text(table)
    return place


def ur10_folder(place: Path, rows: np.ndarray) -> Path:
    machine = sm.load_machine("ur10")
    columns = [f"q{i}" for i in range(1, 7)]
    head = "machine: ur10\nquantity: position\nunits: {length: mm}\nnoise: {dx: 0.01, dy: 0.01, dz: 0.01}\ncommand:\n"
    head += "".join(
        f"  {c}: {{actuator: {a}, unit: rad}}\n" for c, a in zip(columns, machine.actuators, strict=True)
    )
    text = ",".join([*columns, "dx", "dy", "dz"]) + "\n"
    text += "".join(",".join([*map(repr, map(float, q)), "0", "0", "0"]) + "\n" for q in rows)
    return folder(place, head, text)


@pytest.mark.parametrize("branch", [np.array([0.1, -0.9, 1.4, -2.0, -1.5, 0.2]), ELBOW_DOWN])
def test_a_zero_offset_moves_the_tool_as_the_table_says_in_every_branch(
    branch: np.ndarray, tmp_path: Path
) -> None:
    machine = sm.load_machine("ur10")
    e = load_experiment(ur10_folder(tmp_path, branch + np.linspace(0, 0.3, 4)[:, None]))
    error = 1e-3
    term = AppliedEffect("zero_offset", "elbow", ("arm",), (("error", error),))
    found = Predictor(machine, e)([term])[:, :3]
    for row, q in zip(found, e.command, strict=True):  # type: ignore[arg-type]
        off = q + error * np.eye(6)[2]
        np.testing.assert_allclose(row, (ur10(off) - ur10(q))[:3, 3], atol=1e-9)


def test_deflection_at_joints_is_that_of_springs_in_series() -> None:
    machine = sm.load_machine("ur10")
    force = np.array([20.0, -30.0, 40.0])
    got = machine.solve_joints(ELBOW_DOWN, np.append(force, np.zeros(3)), stiffness=False)
    assert got.ok
    compliance = np.array([2.5e-5, 2.5e-5, 5e-5, 1.25e-4, 1.25e-4, 1.25e-4])
    twist, angle = np.zeros(6), ELBOW_DOWN.copy()
    for _ in range(60):  # torque of each joint by virtual work, central differences
        ahead, behind = ([ur10(angle + s * 1e-6 * np.eye(6)[i])[:3, 3] for i in range(6)] for s in (1, -1))
        torque = (np.array(ahead) - np.array(behind)) / 2e-6 @ force
        angle = ELBOW_DOWN + compliance * torque
    twist = (ur10(angle) - ur10(ELBOW_DOWN))[:3, 3]
    np.testing.assert_allclose(got.displacement[:3], twist, rtol=1e-6)


def test_rows_out_of_reach_are_set_aside_by_name() -> None:
    machine = sm.load_machine("linear-delta")
    plan = with_command(random_plan(machine, "position", poses=12, repeats=1), machine)
    assert plan.command is not None
    plan.command[[3, 7]] += np.array([3.0, 0.0, -3.0])
    predictor = Predictor(machine, plan)
    assert len(predictor.experiment) == 10
    assert "2 rows (id 4, 8" in predictor.experiment.out_of_reach[0]
    plan.command[:] += np.array([3.0, 0.0, -3.0])
    with pytest.raises(sm.StiffmapError, match="12 rows"):
        Predictor(machine, plan)


def test_poses_out_of_reach_are_set_aside_too() -> None:
    machine = sm.load_machine("rotary-delta")
    plan = random_plan(machine, "position", poses=9, repeats=1)
    plan.position[2] = 9.0
    assert "1 row (id 3" in Predictor(machine, plan).experiment.out_of_reach[0]
    assert len(simulate(machine, plan)) == 8


@pytest.mark.parametrize("name", ["linear-delta", "rotary-delta", "hexapod", "hybrid", "five-bar", "3-rps"])
def test_joints_and_poses_tell_the_same_of_a_parallel_machine(name: str) -> None:
    machine = sm.load_machine(name)
    plan = random_plan(machine, poses=3, loads=2, repeats=1, force=50.0)
    by_joints = with_command(replace(plan), machine)
    np.testing.assert_allclose(Predictor(machine, by_joints)(), Predictor(machine, plan)(), atol=1e-10)

"""Drives that give way by what the tool rises with them (theory G4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.identification.diagnosis.test_sag import rigid_and_weightless
from tests.python.solve.compiled.agreement import draw, gap

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.model.with_errors import edited

SAGS = {"base": 3e-3, "shoulder": 1e-3, "elbow": 2e-3, "wrist_1": 4e-3}
Q = np.radians([10.0, -60.0, 80.0, -110.0, -80.0, 15.0])


def sagging(machine: sm.Machine, sags: dict[str, float]) -> sm.Machine:
    return sm.Machine(edited(machine.description, {(name, "sag"): s for name, s in sags.items()}))


def lean(machine: sm.Machine) -> sm.Machine:
    return sagging(machine, {f"arm.{name}": s for name, s in SAGS.items()})


def risen(machine: sm.Machine, up: Floats, step: float = 1e-5) -> Floats:
    """(drives,) what the tool rises per unit of each drive, by central differences."""
    out = []
    for unit in step * np.eye(len(Q)):
        ends = [sm.forward_kinematics(machine, Q + s * unit, start=Q).position for s in (1.0, -1.0)]
        out.append((ends[0] - ends[1]) @ up / (2 * step))
    return np.array(out)


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (3.0, -4.0, -2.0)])
def test_an_arm_stands_where_its_drives_have_given_way(gravity: tuple[float, ...], method: str) -> None:
    machine = rigid_and_weightless(sm.load_machine("ur10"))
    at = sm.forward_kinematics(machine, Q)
    size = np.linalg.norm(gravity)
    up = -np.array(gravity) / size if size else np.array([0.0, 0.0, 1.0])
    sag = np.array([SAGS.get(name.removeprefix("arm."), 0.0) for name in machine.actuators])
    expected = sm.forward_kinematics(machine, Q - sag * risen(machine, up), start=Q)
    found = lean(machine).solve_joints(Q, gravity=gravity, method=method)
    moved = found.displacement[:3]
    assert np.linalg.norm(moved) > 1e-3
    assert moved == pytest.approx(expected.position - at.position, abs=1e-9)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (3.0, -4.0, -2.0)])
def test_both_paths_under_loads(gravity: tuple[float, ...]) -> None:
    machine = lean(sm.load_machine("ur10"))
    assert machine.fast == ""
    assert gap(machine, *draw(machine, 40, seed=5), gravity=gravity).worst() < 1e-10


def test_a_file_keeps_it(tmp_path: Path) -> None:
    machine = lean(sm.load_machine("ur10"))
    machine.save(tmp_path / "lean.yaml")
    assert sm.load_machine(tmp_path / "lean.yaml").description == machine.description


@pytest.mark.parametrize(("name", "joint"), [("rotary-delta", "a.motor"), ("travelling-column", "column.x")])
def test_loops_and_slides_have_none(name: str, joint: str) -> None:
    machine = sm.load_machine(name)
    drive = joint if joint in machine.actuators else machine.actuators[0]
    with pytest.raises(StiffmapError, match=rf"{drive}.*sag.*one chain"):
        sagging(machine, {drive: 1e-3})

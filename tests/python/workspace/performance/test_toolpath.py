"""Measures along a toolpath: compliance in the direction of its force, efforts; in tables, requirements and designs."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.design import load_design
from stiffmap.workspace.design.judging import judge
from stiffmap.workspace.performance import load_requirements
from stiffmap.workspace.performance.motion.motion_files import Motion

GANTRY = """
name: gantry
units: {length: m, force: N, angle: rad, mass: kg}
workspace: {x: [-0.1, 0.1], y: [-0.1, 0.1], z: [-0.1, 0.1]}
task: [x, y, z]
legs:
  one:
    elements:
      - {actuator: a, kind: prismatic, axis: x, compliance: 1.0e-6, force: 100}
      - {actuator: b, kind: prismatic, axis: y, compliance: 3.0e-6, force: 100}
      - {actuator: c, kind: prismatic, axis: z, compliance: 5.0e-6, force: 100}
      - {body: tool, mass: 2}
"""
MOTION = """
name: cut
line: {start: [-50 mm, 0 mm, 0 mm], end: [50 mm, 20 mm, 0 mm]}
duration: 1 s
force: [FORCE]
"""


def files(tmp_path, force="30 N, 40 N, 0 N"):
    (tmp_path / "gantry.yaml").write_text(GANTRY, encoding="utf-8")
    (tmp_path / "cut.yaml").write_text(MOTION.replace("FORCE", force), encoding="utf-8")
    return sm.load_machine(tmp_path / "gantry.yaml"), tmp_path / "cut.yaml"


def test_three_springs_in_a_row_by_hand(tmp_path):
    machine, cut = files(tmp_path)
    row = sm.measures(machine, only=["path_compliance"], toolpath=cut)["path_compliance"]
    assert row.found.worst == pytest.approx(0.36 * 1e-6 + 0.64 * 3e-6, rel=1e-9)
    machine, cut = files(tmp_path, "0 N, 0 N, -7 N")
    assert sm.measures(machine, only=["path_compliance"], toolpath=cut)[
        "path_compliance"
    ].found.worst == pytest.approx(5e-6)


def test_the_orthoglide_by_more_force():
    """What ten newtons more move the tool along the force, per newton, at every place of the path."""
    machine = sm.load_machine("orthoglide-revised")
    force = np.array([200.0, -120.0, 60.0])
    path = sm.workspace.performance.line([-0.15, -0.1, 0.0], [0.2, 0.25, 0.1], 41)
    motion = Motion("cut", path, None, 1.0, np.inf, force)
    found = sm.measures(machine, only=["path_compliance"], toolpath=motion)["path_compliance"].found
    unit = force / np.linalg.norm(force)
    moved = [
        machine.solve(path.position, np.append(force + s * unit, np.zeros(3))).displacement[:, :3] @ unit
        for s in (-5.0, 5.0)
    ]
    np.testing.assert_allclose(found.values, (moved[1] - moved[0]) / 10, rtol=1e-5)
    assert found.worst == pytest.approx(found.values.max())


def test_efforts_of_the_path_by_hand(tmp_path):
    """From rest to rest in a second: the largest acceleration of the septic, 84 sqrt(5)/25 of the way; and the force."""
    machine, cut = files(tmp_path)
    row = sm.measures(machine, only=["path_effort"], toolpath=cut)["path_effort"]
    e = sm.drive_efforts(machine, sm.workspace.performance.load_motion(cut).trajectory(machine))
    assert row.found.worst == pytest.approx(np.abs(e.effort.values).max() / 100)
    most = 84 * np.sqrt(5) / 25
    assert row.found.worst == pytest.approx((40 + 2 * 0.02 * most) / 100, rel=1e-3)


def test_requirements_and_designs_name_the_path(tmp_path):
    files(tmp_path)
    (tmp_path / "task.yaml").write_text(
        "name: task\ntoolpath: cut.yaml\nrequirements: {path_compliance: {at_most: 2 um/N}}\n",
        encoding="utf-8",
    )
    task = load_requirements(tmp_path / "task.yaml")
    table = sm.measures(
        sm.load_machine(tmp_path / "gantry.yaml"), requirements=task, only=["path_compliance"]
    )
    assert table["path_compliance"].verdict == "fail"
    assert table["path_compliance"].margin == pytest.approx(2e-6 - 2.28e-6)
    (tmp_path / "design.yaml").write_text(
        """
name: stiff
machine: gantry.yaml
toolpath: cut.yaml
variables: {drive: {low: 1.0e-6, high: 4.0e-6}}
numbers: {"legs.one.elements.actuator[b].compliance": drive}
objectives: [path_compliance]
""",
        encoding="utf-8",
    )
    design = load_design(tmp_path / "design.yaml")
    assert judge(design, np.array([2e-6])).values["path_compliance"] == pytest.approx(0.36e-6 + 0.64 * 2e-6)


def test_without_a_path_or_a_force_it_says_so(tmp_path):
    machine, cut = files(tmp_path, "0 N, 0 N, 0 N")
    none = sm.measures(machine, only=["path_compliance", "path_effort"])
    assert (
        "needs a toolpath" in none["path_compliance"].reason
        and "needs a toolpath" in none["path_effort"].reason
    )
    still = sm.measures(machine, only=["path_compliance"], toolpath=cut)
    assert "needs a force along the toolpath" in still["path_compliance"].reason
    text = "name: d\nmachine: gantry.yaml\ntoolpath: none.yaml\nvariables: {k: {low: 1, high: 2}}\n"
    text += 'numbers: {"legs.one.elements.body[tool].mass": k}\nobjectives: [mass]\n'
    (tmp_path / "design.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match=r"none\.yaml"):
        load_design(tmp_path / "design.yaml")

"""`stiffmap check` as an adviser: quiet about good machines, plain about bad ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import ExternalSpring, Joint, Leg, MachineDescription, Point
from stiffmap.model.files.shipped import machine_folder, starter_text
from stiffmap.solve.advice import advice
from stiffmap.solve.mobility import twist_words
from stiffmap.solve.trial import positions, tried
from stiffmap.ui.cli import main

STARTER = starter_text("m")
FIVE_BAR = (machine_folder() / "five-bar.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", sm.machine_names())
def test_shipped_machines_are_left_in_peace(name: str) -> None:
    assert advice(sm.load_machine(name), name) == []


TRIPTERON = (machine_folder() / "tripteron.yaml").read_text(encoding="utf-8")
COLUMN = (machine_folder() / "travelling-column.yaml").read_text(encoding="utf-8")
CASES = {
    "ram": (
        COLUMN,
        "        stroke: {joint: ram_drive}\n",
        "",
        "'ram_drive' slides along the beam of 'ram', whose length stays 120",
    ),
    "modulus": (
        STARTER,
        "E: 2.1e5",
        "E: 2.1e11",
        "materials.steel.E = 2.1e+11 N/mm² is no solid (steel: 2.1e+05",
    ),
    "modulus in GPa": (
        STARTER,
        "E: 2.1e5",
        "E: 210",
        "materials.steel.E = 210 N/mm² is no solid (steel: 2.1e+05",
    ),
    "density in t": (
        STARTER,
        "density: 7.85e-6",
        "density: 7.85e-9",
        "materials.steel.density = 7.85e-09 kg/mm³ is no solid (steel: 7.85e-06 kg/mm³",
    ),
    "beam in m": (
        STARTER,
        "length: 500\n",
        "length: 0.5\n",
        "the beam of 'bar' is 0.5 mm long, the offset before it spans 500 mm",
    ),
    "mass": (STARTER, "mass: 6", "mass: 5000", "5000 kg is more than solid steel"),
    "beam": (
        STARTER,
        "length: 500\n",
        "length: 5000\n",
        "the beam of 'bar' is 5000 mm long, the offset before it spans 500 mm",
    ),
    "box": (STARTER, "y: [320, 430]", "y: [320, 630]", "3 of 9 positions of the workspace cannot be reached"),
    "box in m": (
        STARTER,
        "y: [320, 430]",
        "y: [0.32, 0.43]",
        "399.6 mm outside of the workspace, whose longest side is 200 mm: are both in mm?",
    ),
    "limit": (
        STARTER,
        "range: [-200, 200]",
        "range: [0, 200]",
        "left.drive: home lies at the end of its range",
    ),
    "weightless": (TRIPTERON, "units: ", "gravity: [0, 0, -9.81]\nunits: ", "gravity pulls on nothing"),
    "no task": (FIVE_BAR, "task: [x, y]", "", "2 drives, 6 components commanded; name those that are"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_odd_is_named(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, old, new, words = CASES[name]
    assert old in text
    (tmp_path / "m.yaml").write_text(text.replace(old, new), encoding="utf-8")
    assert main(["check", str(tmp_path / "m.yaml")]) == 0
    assert "warning: " in capsys.readouterr().out
    assert any(words in a for a in advice(sm.load_machine(tmp_path / "m.yaml"), tmp_path / "m.yaml"))


def test_free_motions_in_words() -> None:
    assert twist_words(np.array([0, 0, 0, 0, 0, 1.0]), 0.5) == "turn about z"
    assert twist_words(np.array([1.0, 0, 0, 0, 0, 0]), 0.5) == "move along x"
    assert twist_words(np.array([0.4, 0, 0, 0, 0, 1.0]), 0.5) == "turn about z and shift with it"
    assert twist_words(np.array([1.0, 1.0, 0, 0, 0, 0]), 0.5) == "move along (0.71, 0.71, 0)"


def test_a_rigid_machine_is_named(tmp_path: Path) -> None:
    text = """name: rigid
units: {length: mm, force: N, angle: deg}
home: {translation: [500, 0, 0]}
legs:
  arm:
    elements:
      - {actuator: drive, kind: prismatic, axis: x, rigid: true}
      - {offset: length, translation: [500, 0, 0]}
"""
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    assert any("rigid" in a for a in advice(sm.load_machine(tmp_path / "m.yaml"), tmp_path / "m.yaml"))


def test_the_box_is_tried_free_and_loaded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A compliance in the wrong unit, and a machine that loses its hold away from home."""
    assert main(["check", "five-bar"]) == 0
    assert "softest direction over the workspace: 0.12 … 0.35 N/µm" in capsys.readouterr().out
    tripteron = sm.load_machine("tripteron")
    low, high = tripteron.workspace
    t = tried(tripteron)
    p = positions(tripteron)
    assert len(p) == 28
    assert (p[1:] > low).all()
    assert (p[1:] < high).all()
    soft = [np.linalg.eigvalsh(c[:3, :3])[-1] for c in tripteron.solve(p).compliance]
    assert t.stiffness == pytest.approx((1 / max(soft), 1 / min(soft)), rel=1e-9)
    old = "compliance: {k11: 1.0e-7, k22: 6.0e-7"
    assert old in COLUMN
    (tmp_path / "m.yaml").write_text(
        COLUMN.replace(old, "compliance: {k11: 1.0e-7, k22: 6.0e+2"), encoding="utf-8"
    )
    found = advice(sm.load_machine(tmp_path / "m.yaml"), tmp_path / "m.yaml")
    assert any("very soft: 0.0017 N move the tool by 1 mm" in a for a in found), found


PENDULUM = """
name: pendulum
units: {length: mm, force: N, angle: deg}
home: {translation: [0, 0, 300]}
task: [z]
workspace: {x: [-1, 1], y: [-1, 1], z: [250, 350]}
legs:
  a:
    elements:
      - {actuator: lift, kind: prismatic, axis: z, home: 0, compliance: 1e-5}
      - {spring: hinge, stiffness: [1e6, 1e6, 1e6, 0, 1e8, 1e8]}
      - {offset: arm, translation: [0, 0, 300]}
"""


def test_what_is_free_is_said_in_words(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(PENDULUM, encoding="utf-8")
    found = advice(sm.load_machine(tmp_path / "m.yaml"), tmp_path / "m.yaml")
    (said,) = [
        a for a in found if "the platform can turn about x" in a
    ]  # of home, once and not for each position
    assert "although all drives stand still" in said


def test_what_springs_outside_hold_is_not_called_rigid(tmp_path: Path) -> None:
    """A slide that no spring of its own holds, and a cord: it has a stiffness, so that it is not rigid."""
    cord = ExternalSpring("cord", "arm.eye", (0.0, 0.0, 1.0), 1e4, 0.5)
    slide = Joint("slide", "prismatic", ((0.0, 0.0, 1.0),))
    machine = MachineDescription(
        "hung", (Leg("arm", (slide, Point("eye"))),), external_springs=(cord,), task=("z",)
    )
    path = tmp_path / "hung.yaml"
    sm.Machine(machine).save(path)
    hung = sm.load_machine(path)
    assert tried(hung).stiffness is not None
    assert not [line for line in advice(hung, path) if "rigid" in line]

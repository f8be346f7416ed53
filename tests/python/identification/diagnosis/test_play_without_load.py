"""Play of a serial drive under loads of which some do not press the gap: an equilibrium set, not a failure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Experiment, Predictor, simulate
from stiffmap.experiment.virtual.plans import load_set, plan_of_poses, random_poses
from stiffmap.identification.diagnosis import Diagnosis
from stiffmap.model.description import AppliedEffect
from stiffmap.ui.cli.diagnose import write
from stiffmap.ui.report.diagnosis import pictures

GAP = 3e-6


def plan(name: str, poses: int = 6) -> tuple[sm.Machine, Experiment]:
    machine = sm.load_machine(name)
    return machine, plan_of_poses(
        machine, "deflection", random_poses(machine, poses, 1), load_set("axes", (60.0, 150.0)), noise=2e-7
    )


def test_readings_are_those_of_the_spring_and_of_half_the_gap_where_the_load_presses() -> None:
    """A column that slides along x: loads along x cross the gap, loads across it find the machine as it was."""
    machine, data = plan("travelling-column")
    bare = Predictor(machine, data)()
    term = AppliedEffect("dead_zone", "column_drive", (), (("half_width", GAP),))
    moved = Predictor(machine, data)([term]) - bare
    along = data.wrench[:, 0]
    assert moved[:, 0] == pytest.approx(GAP * np.sign(along), abs=2e-9)
    assert moved[along == 0.0, 1:3] == pytest.approx(0.0, abs=2e-9)


def test_play_is_named() -> None:
    machine, data = plan("travelling-column")
    far = machine.with_effect("dead_zone", element="column_drive", half_width=GAP)
    d = sm.diagnose(machine, simulate(far, data, [], seed=1), cross_validate=False)
    (found,) = d.effects
    assert (found.kind, found.element) == ("dead_zone", "column_drive")
    value, low, high, _ = found.parameters["half_width"]
    assert low < GAP < high and value == pytest.approx(GAP, rel=0.2)


def test_an_answer_does_not_depend_on_its_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine, data = plan("orthoglide-revised", 3)
    far = machine.with_effect("compliance", legs=["x"], element="actuator", scale=3.0)
    d = sm.diagnose(machine, simulate(far, data, [], seed=1), cross_validate=False)

    def fails(d: Diagnosis) -> Figure:
        raise StiffmapError("singular")

    monkeypatch.setattr(pictures, "loaded", fails)
    made: list[object] = []  # for the files and the page, once
    monkeypatch.setattr(pictures, "before_after", lambda d: made.append(d) or fails(d))
    write(d, tmp_path)
    assert made == [d]
    assert {"machine.yaml", "report.html", "diagnosis.json", "loaded.png"} <= {
        p.name for p in tmp_path.iterdir()
    }
    said = pictures.drawn(fails, d).texts[0].get_text()
    assert said == "not drawn: singular"

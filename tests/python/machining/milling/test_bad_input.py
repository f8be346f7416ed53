"""What cannot be milled: one message each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling import mill_job
from stiffmap.machining.milling.choices import choices
from stiffmap.machining.milling.limits import SOURCES, slots
from stiffmap.machining.toolpath import path_of
from stiffmap.machining.toolpath.gcode.load import load_gcode

M = sm.load_machine("linear-delta")
LINE = path_of([[-0.02, 0, 0], [0.02, 0, 0]])


def test_a_path_that_leaves_the_workspace_names_points_and_a_place() -> None:
    with pytest.raises(StiffmapError) as caught:
        mill_job(M, path_of([[0, 0, 0], [0.15, 0, 0]]), "trimming", at=(0.08, 0, 0.3), step=0.01)
    text = str(caught.value)
    assert "leaves the workspace of linear-delta" in text
    assert "beyond the declared box by up to (130.0, 0.0, 0.0) mm" in text
    place = text.rsplit("origin at (", 1)[1].split(")")[0]
    at = 1e-3 * np.array([float(v) for v in place.split(",")])
    assert at[0] == pytest.approx(-0.075)
    mill_job(M, path_of([[0, 0, 0], [0.15, 0, 0]]), "trimming", at=at, step=0.01)


def test_a_part_that_is_too_large() -> None:
    with pytest.raises(StiffmapError, match="larger than that box"):
        mill_job(M, "washbasin", "trimming", at=(0.1, 0, 0.3), step=0.01)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("G21 G90 F600 S6000 M5", "line 2: the spindle is off"),
        ("G21 G90 F600 S6000", "line 2: the spindle is off"),
        ("G21 G90 F600 M3", "line 2: the spindle is off"),
        ("G21 G90 F600 S6000 M4", "counter-clockwise"),
    ],
)
def test_the_spindle(head: str, message: str) -> None:
    path = load_gcode([head, "G1 X10", "M2"], name="p")
    with pytest.raises(StiffmapError, match=message):
        mill_job(M, path, "trimming", at=(0, 0, 0.3))


def test_a_chip_thicker_than_its_tool() -> None:
    path = load_gcode(["G21 G90 F9000000 S60 M3", "G1 X10", "M2"], name="p")
    with pytest.raises(StiffmapError, match="line 2: the chip is too thick"):
        mill_job(M, path, "slot", at=(0, 0, 0.3))


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ({"passes": 0}, "passes: expected 1 or more"),
        ({"at": (0, 0)}, "at: expected three finite numbers"),
        ({"step": 0.0}, "step: expected a positive number"),
        ({"true_machine": sm.load_machine("ur10")}, "true_machine: expected the actuators"),
        ({"turn": 90}, r"turn: expected at most a full turn \(2 pi rad\), got 90 rad"),
        ({"step": 2}, "step: expected at most 1000 mm, got 2000 mm"),
        ({"within": 0.05}, "within: expected at most the tool's diameter of 12 mm, got 50 mm"),
        ({"tolerance": 0.25}, "tolerance: expected at most the tool's diameter of 12 mm, got 250 mm"),
        ({"thickness": 4}, "thickness: expected at most the tool's diameter of 12 mm, got 4000 mm"),
        ({"thickness": -1}, "thickness: expected a positive number"),
    ],
    ids=str,
)
def test_arguments(argument: dict[str, object], message: str) -> None:
    with pytest.raises(StiffmapError, match=message):
        mill_job(M, LINE, "trimming", **{"at": (0, 0, 0.3), **argument})


def test_a_slot_is_as_wide_as_its_tool() -> None:
    with pytest.raises(StiffmapError, match="thickness: a slot is as wide as its tool"):
        mill_job(M, LINE, "slot", at=(0, 0, 0.3), thickness=2e-3)
    for low, count in ((-0.02, 0), (0.0, 11)):
        stock = [-1, low, -0.1, 0, 0.02, 0.1]
        job = choices(
            M, LINE, "slot", at=(0, 0, 0.3), stock=stock, step=2e-3, thickness=None, threads=None
        ).job
        assert [w.points.sum() for w in slots(job, xr.Dataset())] == [count]
    assert slots in SOURCES


def test_files_that_are_not_there() -> None:
    with pytest.raises(StiffmapError, match="no such process"):
        mill_job(M, LINE, "trim", at=(0, 0, 0.3))
    with pytest.raises(StiffmapError, match="no such file"):
        mill_job(M, Path("nowhere.ngc"), "trimming")


def test_a_tilt_that_the_machine_does_not_have() -> None:
    path = path_of([[-0.02, 0, 0], [0, 0, 0], [0.02, 0, 0]], tool=[[0, 0, 1], [0, 0, 1], [0, 0.5, 1]])
    with pytest.raises(
        StiffmapError, match=r"cannot hold the tool .* tilted by up to 26.57 deg: 10 of 21 points"
    ):
        mill_job(M, path, "trimming", at=(0, 0, 0.3))

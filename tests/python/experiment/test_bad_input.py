"""Bad input at the command line: one clear line, no traceback, exit code 2; or a named limit."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import random_plan
from stiffmap.ui.cli.app import main

HEAD = (
    "machine: orthoglide-revised\nquantity: deflection\nunits: {length: mm, force: N, angle: rad}\n"
    "noise: {dx: 0.003, dy: 0.003}\n"
)
ROWS = (
    "id,x,y,z,fx,fy,fz,dx,dy\n1,0,0,0,100,0,0,0.049,0\n2,0,0,0,-100,0,0,-0.049,0\n"
    "3,90,0,0,100,0,0,0.049,0\n4,0,80,0,100,0,0,0.049,0\n"
)
Change = Callable[[str], str]


def swap(old: str, new: str) -> Change:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


def same(text: str) -> str:
    return text


CASES: dict[str, tuple[Change, Change, tuple[str, ...]]] = {
    "missing column": (same, swap("id,x,y,z", "id,x,y,q"), ("data.csv, line 1", "'q'")),
    "no z": (
        same,
        lambda t: "\n".join(",".join(r.split(",")[:3] + r.split(",")[4:]) for r in t.split()),
        ("data.csv", "missing column 'z'"),
    ),
    "unit of force": (swap(", force: N", ""), same, ("'force' is not declared", "'fx'")),
    "unit of angle": (
        swap(", angle: rad", ""),
        swap("dx,dy\n", "dx,rx\n"),
        ("'angle' is not declared", "'rx'"),
    ),
    "no units": (swap("units: {length: mm, force: N, angle: rad}\n", ""), same, ("units",)),
    "off the workspace": (
        same,
        lambda t: re.sub(r"(?m)^(\d+),[-\d.]+,", r"\1,5000,", t),
        ("no equilibrium at", "id 1", "(5000.0,", "out of reach"),
    ),
    "twice the same id": (same, swap("3,90", "1,90"), ("data.csv, line 4", "'1' occurs twice", "line 2")),
    "text for a number": (same, swap("-0.049", "oops"), ("data.csv, line 3", "'dx'", "'oops'")),
    "empty force": (same, swap("-100,0,0", ",0,0"), ("data.csv, line 3", "'fx'", "an empty cell")),
    "no reading at all": (
        same,
        lambda t: re.sub(r"(?m),-?0\.049,0$", ",nan,", t),
        ("data.csv", "expected a reading in one row or more of dx, dy; found none"),
    ),
    "infinite": (same, swap("90,0", "inf,0"), ("data.csv, line 4", "'x'", "finite")),
    "poses in µm": (swap("length: mm", "length: um"), same, ("poses x, y, z would be in µm", "dx: um")),
    "noise zero": (swap("dx: 0.003", "dx: 0"), same, ("noise of dx is zero or unknown", "declare it")),
    "noise negative": (swap("dx: 0.003", "dx: -1"), same, ("experiment.yaml", "dx")),
    "unknown point": (swap("units", "point: probe\nunits"), same, ("no point 'probe'", "tcp")),
    "unknown joint": (
        swap("units", "joints: {q: {joint: q.actuator, unit: mm, noise: 1}}\nunits"),
        swap("dx,dy\n", "dx,q\n"),
        ("no joint 'q.actuator'", "x.actuator"),
    ),
    "taken name": (
        swap("units", "joints: {dy: {joint: x.actuator, unit: mm}}\nunits"),
        same,
        ("'dy' has a meaning of its own",),
    ),
    "joint in a wrong unit": (
        swap("units", "joints: {q: {joint: x.actuator, unit: deg, noise: 1}}\nunits"),
        swap("dx,dy\n", "dx,q\n"),
        ("x.actuator reads a length",),
    ),
    "motor of a pin": (
        swap("units", "joints: {q: {joint: x.proximal, unit: rad, side: motor, noise: 1}}\nunits"),
        swap("dx,dy\n", "dx,q\n"),
        ("x.proximal has no motor",),
    ),
    "pose and command": (
        swap("units", "command: {c: {actuator: x.actuator, unit: mm}}\nunits"),
        swap("fz,", "c,"),
        ("data.csv, line 1", "'x'", "actuators are commanded"),
    ),
    "distance under load": (same, swap("dx,dy\n", "dx,dd\n"), ("'dd'", "no deflection")),
    "approach unknown": (swap("units", "unloaded: approach\nunits"), same, ("approach_x",)),
    "body of the instrument": (
        swap("units", "metrology: {instrument_on: table}\nunits"),
        same,
        ("no point 'table'",),
    ),
    "word": (swap("deflection", "deflexion"), same, ("experiment.yaml", "quantity")),
}


def write(folder: Path, head: str = HEAD, rows: str = ROWS) -> Path:
    (folder / "experiment.yaml").write_text(head)
    (folder / "data.csv").write_text(rows)
    return folder


@pytest.mark.parametrize("command", ["residual", "diagnose"])
@pytest.mark.parametrize("name", CASES)
def test_one_line(name: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head, rows, words = CASES[name]
    code = main([command, "orthoglide-revised", str(write(tmp_path, head(HEAD), rows(ROWS)))])
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert err.startswith("stiffmap: ") and err.count("\n") == 1
    for word in words:
        assert word in err


def test_a_folder_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["residual", "orthoglide-revised", "nowhere"]) == 2
    assert "nowhere: there is no such experiment" in capsys.readouterr().err


def residual_lines(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["residual", "orthoglide-revised", str(folder)]) in (0, 1)
    return capsys.readouterr().out


def test_few_readings_have_a_residual_and_no_diagnosis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write(tmp_path, rows="\n".join(ROWS.split()[:3]) + "\n")
    told = residual_lines(folder, capsys)
    assert "4 readings of deflection" in told and "limit: 4 readings show a residual" in told
    assert main(["diagnose", "orthoglide-revised", str(folder)]) == 2
    assert "4 readings are fewer" in capsys.readouterr().err


def test_one_pose_is_a_limit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = ROWS.replace("90,0,0", "0,0,0").replace("0,80,0", "0,0,0")
    assert "limit: all rows are one pose" in residual_lines(write(tmp_path, rows=rows), capsys)


def test_contradictory_repeats_are_a_limit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    extra = "".join(f"{i + 5},90,{i // 2},0,100,0,0,{0.049 + 0.03 * (i % 2)},0\n" for i in range(12))
    told = residual_lines(write(tmp_path, rows=ROWS + extra), capsys)
    assert "limit: contradictory repeats: dx: repeats scatter by" in told


def test_rows_outside_the_declared_box_are_a_limit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = ROWS.replace("4,0,80", "4,310,80")
    assert "limit: 1 row lies outside the workspace of the file" in residual_lines(
        write(tmp_path, rows=rows), capsys
    )


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("quantity", "force", "one of deflection, position"),
        ("frame", "nowhere", "one of known"),
        ("sigma", np.full((9, 6), -1e-6), "0 or more"),
        ("position", np.zeros((4, 3)), "9 entries, one for each row, got the shape .4, 3."),
        ("wrench", None, "9 entries"),
        ("temperature", 20.0, "9 entries"),
        ("order", np.arange(2.0), "9 entries"),
        ("setup", ("a",), "9 entries"),
    ],
)
def test_an_experiment_has_one_entry_for_each_row(name: str, wrong: object, words: str) -> None:
    plan = random_plan("linear-delta", poses=1, loads=9, repeats=1, seed=0)
    assert len(plan) == 9
    with pytest.raises(sm.StiffmapError, match=f"^{name}: expected .*{words}"):
        replace(plan, **{name: wrong})

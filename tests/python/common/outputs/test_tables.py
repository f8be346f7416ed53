"""Tables: no formula for a spreadsheet, no number that only Python reads as one, and back again unchanged."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import number_in
from stiffmap.common.outputs import guarded, unguarded, write_rows
from stiffmap.experiment import load_experiment
from stiffmap.ui.cli import main
from stiffmap.workspace.maps.files import write_map_table

FORMULAS = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "'=1", "''=1", "=", "-", "+1-1"]
PLAIN = ["1", "-1.5", "+2e-3", "-.5", "a=1", "", "it's", "'quoted'", "µm", "-1.", "1e5", " =1"]


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas_are_text(text: str) -> None:
    assert guarded(text) == f"'{text}" and unguarded(guarded(text)) == text


@pytest.mark.parametrize("text", PLAIN)
def test_numbers_and_other_text_stay(text: str) -> None:
    assert guarded(text) == text and unguarded(text) == text


def test_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    assert write_rows(path, ["=x", "y"], [["=1", "-1.5"], [-2.5, None]]) == 2
    assert path.read_text() == "'=x,y\n'=1,-1.5\n-2.5,\n"


def test_names_of_readings_come_back(tmp_path: Path) -> None:
    text = "id,x [mm],y [mm],z [mm],fx [N],fy [N],fz [N],dx [um],remark\n=1+1,1,200,0,10,0,0,1,=2\n@a,2,200,0,10,0,0,1,-\n"
    (tmp_path / "a.csv").write_text(text)
    assert (
        main(
            ["experiment", "new", str(tmp_path / "a.csv"), "--machine", "five-bar", "-o", str(tmp_path / "e")]
        )
        == 0
    )
    cells = [
        c for f in ("data.csv", "notes.csv") for row in csv.reader((tmp_path / "e" / f).open()) for c in row
    ]
    assert not [c for c in cells if c[:1] in "=@"[: len(c)] and c]
    assert load_experiment(tmp_path / "e").ids == ("=1+1", "@a")


def test_names_of_load_cases_in_a_workbook(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    ds = sm.error_map("orthoglide-revised", x=[0.0], y=[0.0], z=[0.0], plane=None,
                      wrench={"=HYPERLINK(1)\x01": [1.0, 0, 0, 0, 0, 0]})  # fmt: skip
    book = openpyxl.load_workbook(write_map_table(ds, tmp_path / "m.xlsx"))
    kinds = {c.data_type for page in book for row in page.iter_rows() for c in row}
    assert kinds <= {"s", "n"}  # none is a formula
    assert (
        "HYPERLINK" in (tmp_path / "m.csv").read_text() if write_map_table(ds, tmp_path / "m.csv") else False
    )
    names = next(csv.reader((tmp_path / "m.csv").open(encoding="utf-8-sig")))
    assert not [n for n in names if n.startswith("=")]


@pytest.mark.parametrize("text", ["1_0", "1_000.5", "１２", "1e1_0"])
def test_what_only_python_takes_for_a_number(text: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="could not convert"):
        number_in(text)
    (tmp_path / "experiment.yaml").write_text(
        "machine: five-bar\nquantity: deflection\nunits: {length: mm, force: N}\nnoise: {dx: 1}\n"
    )
    (tmp_path / "data.csv").write_text(f"id,x,y,z,fx,dx\n1,{text},200,0,10,0.1\n", encoding="utf-8")
    with pytest.raises(FileError, match="column 'x': expected a number; found"):
        load_experiment(tmp_path)
    assert main(["solve", "five-bar", "--force", f"{text},0,0"]) == 2
    assert number_in(" -1e-3 ") == -0.001 and np.isnan(number_in("nan"))

"""Cells that hold several numbers, as lists of Python, numpy, MATLAB and robots are written into tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffmap.common.errors import FileError
from stiffmap.common.tables.pose_table import read_pose_table
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.common.tables.vectors import one_number_a_cell


def parts(*rows: list[str]) -> list[list[str]]:
    lines = one_number_a_cell(lambda: iter(enumerate(map(list, rows), 1)))
    return [cells for _, cells in lines()]


@pytest.mark.parametrize(
    ("cell", "numbers"),
    [
        ("[0.1, -2, 3e-4]", ["0.1", "-2", "3e-4"]),
        ("(1;2;3)", ["1", "2", "3"]),
        ("(50,5; 0; -20,25)", ["50,5", "0", "-20,25"]),
        ("{1.0 2.0 4}", ["1.0", "2.0", "4"]),
        ("[ 0.1 0.2\n 0.3]", ["0.1", "0.2", "0.3"]),
        ("array([1., 2., 3.])", ["1.", "2.", "3."]),
        ("p[0.1,-0.2,0.3,0,3.14,0]", ["0.1", "-0.2", "0.3", "0", "3.14", "0"]),
        ("[1 0; 0 1]", ["1", "0", "0", "1"]),
        ("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", [*"100010001"]),
    ],
)
def test_cells_of_several_numbers(cell: str, numbers: list[str]) -> None:
    assert parts(["1", cell]) == [["1", *numbers]]


@pytest.mark.parametrize(
    "cell", ["(0,5)", "(0.1+0.2j)", "x (mm)", "[mm]", "(a, b, c)", "[1, 2, ok]", "1 2 3", "[1, 2, 3", "(3)"]
)
def test_other_cells_stay(cell: str) -> None:
    assert parts(["1", cell]) == [["1", cell]]


@pytest.mark.parametrize(
    ("name", "cell", "names"),
    [
        ("position [mm]", "[1, 2, 3]", ["position x [mm]", "position y [mm]", "position z [mm]"]),
        ("xyz (mm)", "[1, 2, 3]", ["x [mm]", "y [mm]", "z [mm]"]),
        ("joint_positions [rad]", "[1, 2, 3, 4]", [f"joint {k} [rad]" for k in range(1, 5)]),
        ("actual_q", "[1, 2, 3, 4, 5, 6]", [f"actual_q_{k}" for k in range(6)]),
        ("TCP pose", "[1, 2, 3, 4, 5, 6]", [f"TCP pose {a}" for a in ("x", "y", "z", "rx", "ry", "rz")]),
        ("R", "[1, 0, 0, 0, 1, 0, 0, 0, 1]", [f"r{i}{j}" for i in "123" for j in "123"]),
        ("currents", "[1, 2, 3, 4]", [f"currents {k}" for k in range(1, 5)]),
        ("", "[1, 2, 3]", ["", "", ""]),
        ("mm", "[1, 2, 3]", ["mm", "mm", "mm"]),
    ],
)
def test_names_of_their_parts(name: str, cell: str, names: list[str]) -> None:
    assert parts([name, "id"], [cell, "1"])[0] == [*names, "id"]


def test_a_table_of_vectors_is_one_of_numbers(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(
        'id,position (mm),force (N)\n1,"(50.5, 0, 700)","[1, 2, 3]"\n2,"(0, -20.25, 700)","[0, 0, 0]"\n'
    )
    found = read_pose_table(tmp_path / "p.csv")
    np.testing.assert_allclose(found.position, [[0.0505, 0, 0.7], [0, -0.02025, 0.7]])
    np.testing.assert_allclose(found.wrench[:, :3], [[1, 2, 3], [0, 0, 0]])
    (tmp_path / "p.csv").write_text('id,position (mm)\n1,"(50.5, 0, 700)"\n2,"(0, 700)"\n')
    with pytest.raises(
        FileError, match=r"line 3: column 'position x \[mm\]': expected a number; found '\(0, 700\)'"
    ):
        read_pose_table(tmp_path / "p.csv")


def test_a_table_without_any_is_read_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("a (mm),b [N],remark\n1,2,(see 3)\n2,3,[ok]\n")
    assert read_sheet(tmp_path / "p.csv").header == ("a (mm)", "b [N]", "remark")

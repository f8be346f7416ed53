"""Tables in files of their own become one."""

from pathlib import Path

import pytest

from stiffmap.common.errors import FileError
from stiffmap.common.tables.sheet import Layout, read_sheet
from stiffmap.common.tables.side_by_side import side_by_side
from stiffmap.common.tables.table import Table

PLACES = {"P1": (1, 2, 3), "P2": (4, 5, 6), "P3": (7.5, 8, 9)}


def read(folder: Path, name: str, text: str, numbered: bool = False) -> Table:
    (folder / name).write_text(text, encoding="utf-8")
    return read_sheet(folder / name, layout=Layout(numbered=numbered))


def places(*points: str, header: str = "Name,X [mm],Y [mm],Z [mm]") -> str:
    rows = (",".join(map(str, (p, *PLACES.get(p, (0, 0, 0))))) for p in points)
    return "\n".join([header, *rows])


COMMANDS = "No.;q1;X [mm]\nP1;1,5;0,1\nP2;2,5;0,2\nP3;3,5;0,3\n"


def test_points_of_one_name_stand_next_to_each_other(tmp_path: Path) -> None:
    table = side_by_side([
        read(tmp_path, "a.csv", COMMANDS), read(tmp_path, "b.csv", "taken on Friday;\n\n" + places("P3", "P1"))
    ])  # fmt: skip
    assert table.header == (
        "No.",
        "q1",
        "X [mm]",
        "Name",
        "measured X [mm]",
        "measured Y [mm]",
        "measured Z [mm]",
    )
    assert [*table.columns[0]] == [*table.columns[3]] == ["P3", "P1"]
    assert [table.numbers(i).tolist() for i in (1, 2, 4, 6)] == [[3.5, 1.5], [0.3, 0.1], [7.5, 1], [9, 3]]
    assert [*table.lines] == [4, 5]
    assert table.aside == (f"row 3 of {tmp_path / 'a.csv'}, which no other table has",)


@pytest.mark.parametrize("header", ["Target,X [mm],Y [mm],Z [mm]", "id,X [mm],Y [mm],Z [mm]"])
def test_rows_whose_points_have_no_common_name_are_taken_in_order(header: str, tmp_path: Path) -> None:
    other = places("A", "B", "C", header=header).replace("A,0,0,0", "A,0,0,7")
    table = side_by_side([read(tmp_path, "a.csv", COMMANDS), read(tmp_path, "b.csv", other)])
    assert table.numbers(1).tolist() == [1.5, 2.5, 3.5] and table.numbers(6).tolist() == [7, 0, 0]


def test_columns_without_a_name_are_counted_through(tmp_path: Path) -> None:
    files = [read(tmp_path, f"{n}.csv", "1,2\n3,4\n", numbered=True) for n in "abc"]
    assert side_by_side(files).header == tuple(f"column {i}" for i in range(1, 7))


@pytest.mark.parametrize(
    ("second", "said"),
    [
        (places("P1", "P2", "P4"), "expected the points of .*a.csv by their names; found 'P4'"),
        (places("A", "B"), "expected 3 rows as in .*a.csv, or a column of points' names in both; found 2"),
        (places("P1", "P2", "P3", header="id,q1,measured q1,Z"), "column 'measured q1' occurs twice"),
    ],
)
def test_rows_that_have_no_others_are_refused(second: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=f"b.csv.*{said}"):
        side_by_side([read(tmp_path, "a.csv", COMMANDS), read(tmp_path, "b.csv", second)])

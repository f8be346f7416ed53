"""A last row that is the mean of those above it, as its numbers say, is no reading."""

from __future__ import annotations

from pathlib import Path

import pytest

import stiffmap as sm

HEADER = "id;x [mm];y [mm];z [mm];Fx [N];dx [um];dy [um]\n"
REPEATS = "1;0;390;0;80;21.4;1.2\n2;0;390;0;80;20.9;1.6\n3;0;390;0;80;21.8;1.1\n"
LOADS = "1;0;390;0;0;0.00;0.00\n2;0;390;0;50;5.00;1.00\n3;0;390;0;100;10.00;2.00\n"


def rows_of(text: str, folder: Path) -> tuple[int, list[str]]:
    (folder / "t.csv").write_text(HEADER + text)
    made = sm.experiment_from_table("five-bar", folder / "t.csv", folder / "o", noise={"dx": 1.0, "dy": 1.0})
    return len(made.experiment), [r for r in made.remarks if "is the mean" in r]


@pytest.mark.parametrize(
    ("above", "last"),
    [
        (REPEATS, "Result;0;390;0;80;21.4;1.3\n"),
        (REPEATS, "4;0;390;0;80;21.366666666666667;1.3\n"),
        (REPEATS + "4;0;390;0;80;n/a;1.3\n", "5;0;390;0;80;21.3667;1.30\n"),
        (REPEATS.replace("2;0;", "2;30;"), "Alle;10;390;0;80;21.3667;1.3\n"),
        (REPEATS.replace(".", ","), "4;0;390;0;80;21,37;1,30\n"),
    ],
)
def test_a_last_row_that_is_the_mean_is_left_out(above: str, last: str, tmp_path: Path) -> None:
    count, said = rows_of(above + last, tmp_path)
    assert count == above.count("\n")
    assert said == [f"left out: row {count + 2} is the mean of those above it in every number"]


@pytest.mark.parametrize(
    "text",
    [
        REPEATS + "4;0;390;0;80;21.3;1.2\n",  # another reading
        LOADS + "4;0;390;0;50;5.00;1.00\n",  # loads up and down, readings in proportion
        "1;0;390;0;80;21;1\n2;0;390;0;80;20;1\n3;0;390;0;80;22;2\n4;0;390;0;80;21;1\n",  # as chance has it
        REPEATS.rpartition("3;0")[0] + "3;0;390;0;80;21.15;1.40\n",  # of two
    ],
)
def test_a_last_row_that_may_be_a_reading_stays(text: str, tmp_path: Path) -> None:
    count, said = rows_of(text, tmp_path)
    assert count == text.count("\n")
    assert not said

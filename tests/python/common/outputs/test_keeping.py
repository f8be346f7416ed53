"""An output is never one of the inputs, and nothing that a user has is replaced unasked."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.common.outputs import asked_to_replace, one_command, putting, write_rows, write_text
from stiffmap.ui.cli import main

ROOT = Path(__file__).parents[4]
DATA = ROOT / "tests/data/experiments/C-backlash"
SIMULATE = ["simulate", "five-bar", "--poses", "4", "--loads", "2", "-o"]


def contents(folder: Path) -> dict[str, bytes]:
    """What a user sees of a folder."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a machine file that has comments, readings, poses and a program."""
    sm.load_machine("five-bar").save(tmp_path / "machine.yaml")
    (tmp_path / "machine.yaml").write_text("# mine\n" + (tmp_path / "machine.yaml").read_text())
    shutil.copytree(DATA, tmp_path / "measured")
    (tmp_path / "p.csv").write_text("x [mm],y [mm],z [mm]\n0,400,0\n20,420,0\n")
    (tmp_path / "map.nc").write_text("mine")
    (tmp_path / "five-bar.png").write_text("mine")
    monkeypatch.chdir(tmp_path)
    return tmp_path


COMMANDS = [
    [*SIMULATE, "measured"],
    ["calibrate", "machine.yaml", "twin", "-o", ".", "--budget", "1"],
    ["compensate", "machine.yaml", "p.csv", "--effect", "zero_offset left.drive error=1mrad", "-o", "p.csv"],
    ["solve", "machine.yaml", "--at", "p.csv", "--force", "10,0,0", "-o", "p.csv"],
    ["solve", "machine.yaml", "--at", "p.csv", "--force", "10,0,0", "-o", "machine.yaml"],
    ["map", "machine.yaml", "--points", "3", "-o", "."],
    ["show", "five-bar"],
    ["plan", "machine.yaml", "-o", "p.csv"],
    ["view", "machine.yaml", "--html", "machine.yaml"],
]


@pytest.mark.parametrize("words", COMMANDS, ids=lambda w: " ".join(w[:2] + w[-2:]))
def test_what_the_user_has_stays(words: list[str], desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if "twin" in words:
        assert main([*SIMULATE, "twin", "--quantity", "position"]) == 0
    before = contents(desk), contents(desk / "measured")
    capsys.readouterr()
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith("stiffmap: ") and error.count("\n") == 1
    assert "cannot be written: " in error and "name another output" in error
    after = contents(desk), contents(desk / "measured")
    assert all(after[i][name] == text for i in (0, 1) for name, text in before[i].items())


def test_a_command_may_be_repeated_until_its_output_is_edited(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*SIMULATE, "twin"]) == 0
    assert main([*SIMULATE, "twin", "--seed", "1"]) == 0  # other readings over those of stiffmap
    with (desk / "twin/data.csv").open("a") as file:
        file.write("\n")
    assert main([*SIMULATE, "twin"]) == 2
    assert "twin/data.csv" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["simulate", "five-bar", "--plan", "twin", "-o", "twin"],
        ["solve", "link.yaml", "--at", "p.csv", "--force", "10,0,0", "-o", "own.yaml"],
        ["view", "own.yaml", "--html", "own.yaml"],
        ["new", "--overwrite", "--from", "hexapod", "again.yaml"],
    ],
    ids=lambda w: w[0],
)
def test_what_stiffmap_wrote_is_an_input_when_it_is_read(
    words: list[str], desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*SIMULATE, "twin"]) == 0
    assert main(["new", "--from", "hexapod", "own.yaml"]) == 0
    assert main(["new", "--from", "hexapod", "again.yaml"]) == 0
    (desk / "link.yaml").symlink_to("own.yaml")
    before = contents(desk), contents(desk / "twin")
    capsys.readouterr()
    if words[0] == "new":  # which reads nothing, and was asked to
        assert main(words) == 0
        return
    assert main(words) == 2
    assert "replaces no input" in capsys.readouterr().err
    assert (contents(desk), contents(desk / "twin")) == before


def test_each_way_to_write(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "empty").write_text("")

    def together() -> None:
        with putting(tmp_path, "mine") as fresh:
            (fresh / "mine").write_text("new")

    with one_command():
        for call in (
            lambda: write_text(tmp_path / "mine", "new"),
            lambda: write_rows(tmp_path / "mine", ["a"], [[1]]),
            together,
        ):
            with pytest.raises(FileError, match="no command of stiffmap wrote"):
                call()
        assert (tmp_path / "mine").read_text() == "mine"
        write_text(tmp_path / "empty", "new")
        write_text(tmp_path / "empty", "twice")
        assert (tmp_path / "empty").read_text() == "twice"
    with one_command():
        write_text(tmp_path / "empty", "by another command")
        asked_to_replace(tmp_path)
        write_text(tmp_path / "mine", "as asked")
    write_text(tmp_path / "empty", "from Python, as the caller says")

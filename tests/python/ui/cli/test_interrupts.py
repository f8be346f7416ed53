"""Ctrl-C is quiet wherever it comes; what the system refuses is one line."""

from __future__ import annotations

import subprocess
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from stiffmap.ui.cli import main

INTERRUPTED = """
import sys, stiffmap.ui.cli
class Finder:
    def find_spec(self, name, *rest):
        if name == sys.argv[1]:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Finder())
sys.exit(stiffmap.ui.cli.main(sys.argv[2:]))
"""


@pytest.mark.parametrize(
    "module",
    ["typer", "stiffmap.ui.cli.commands", "stiffmap.ui.cli.machines", "stiffmap.model.files.shipped"],
)
def test_ctrl_c_during_imports_is_quiet(module: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, "machines"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert "Traceback" not in done.stderr and "KeyboardInterrupt" not in done.stderr


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8"])
@pytest.mark.parametrize(
    "command", [["machines"], ["effects"], ["solve", "orthoglide-revised", "--force", "300,0,0"], ["--help"]]
)
def test_every_terminal_can_show_the_answer(
    command: list[str], encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    terminal, errors = (TextIOWrapper(BytesIO(), encoding=encoding) for _ in range(2))
    monkeypatch.setattr("sys.stdout", terminal)
    monkeypatch.setattr("sys.stderr", errors)
    assert main(command) == 0
    terminal.flush()
    errors.flush()
    assert terminal.buffer.getvalue().decode(encoding) and errors.buffer.getvalue() == b""


def test_folders_and_files_with_umlauts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "Geräte größer als µm 機械"
    folder.mkdir()
    assert main(["new", str(folder / "müßig.yaml")]) == 0
    assert main(["check", str(folder / "müßig.yaml")]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("words", [["check"], ["solve"], ["show"], ["import"], ["efforts", "five-bar"], ["residual", "five-bar"],
                                   ["diagnose", "five-bar"], ["optimize"], ["new"], ["link"], ["monitor", "five-bar", "a"]])  # fmt: skip
@pytest.mark.parametrize(
    "name", ["n" * 300, "a\0b", "a/" * 3000 + "b", "\udcff.yaml"], ids=["long", "zero", "deep", "bytes"]
)
def test_names_that_the_system_refuses_are_one_line(
    words: list[str],
    name: str,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code = main([*words, name])
    err = capfd.readouterr().err
    assert code in ((0, 2) if words == ["new"] else (2,)), err
    assert "defect" not in err and (code == 0 or err.strip())

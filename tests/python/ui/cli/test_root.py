"""The command line: what it prints, where, and its exit codes."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from inspect import getdoc, signature
from pathlib import Path

import pytest
from rich.text import Text
from typer.main import get_command

from stiffmap.common.errors import MissingPartError
from stiffmap.ui.cli import main
from stiffmap.ui.cli.app import build_app, load, styled
from stiffmap.ui.cli.commands import COMMANDS, Command
from stiffmap.ui.view.plane import QUANTITIES


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit code, output, errors."""
    code = main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def test_help_lists_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "--help")
    assert code == 0
    for command in COMMANDS:
        assert command.summary.split()[0] in out


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_commands_and_their_options(shell: str) -> None:
    def completed(line: str) -> str:
        asked = {
            "_STIFFMAP_COMPLETE": f"complete_{shell}",
            "COMP_CWORD": str(len(line.split()) - 1),
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
            "COMP_WORDS" if shell == "bash" else "_TYPER_COMPLETE_ARGS": line,
        }
        command = [sys.executable, "-m", "stiffmap"]
        return subprocess.run(command, env={**os.environ, **asked}, stdout=subprocess.PIPE, text=True).stdout

    started = completed("stiffmap mac")
    assert "machines" in started and "mill" not in started
    assert "--toolpath" in completed("stiffmap map --too")


@pytest.mark.parametrize("name", [command.name for command in COMMANDS])
def test_each_help_string_appears_in_full(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 4000)
    app = build_app([name])
    (function,) = (c.callback for c in app.registered_commands if c.name == name)
    plain = re.compile(r"\[/?(?:cyan|bold)\]")
    expected = [plain.sub("", " ".join(p.split())) for p in (getdoc(function) or "").split("\n\n")]
    expected += [p.help for p in get_command(app).commands[name].params if p.help and not p.hidden]
    code, out, _ = run(capsys, name, "--help")
    assert code == 0
    shown = " ".join(out.split())
    for text in expected:
        assert " ".join(text.split()) in shown


@pytest.mark.parametrize(
    "text", ["x [mm]", "the extra [fea]", "[default: home]", "feed [mm/min] or [/s]", "a \\[b]", "[dim]"]
)
def test_brackets_in_help_are_text(text: str) -> None:
    assert Text.from_markup(styled(f"[bold]{text}[/bold]")).plain == text


def test_help_imports_no_numerics() -> None:
    script = """
import sys
from stiffmap.ui.cli import main
for name in sys.argv[1:]:
    sys.argv[1:] = [*name.split(), "--help"]
    code = main()
    found = {"numpy", "scipy", "pandas", "xarray", "matplotlib"} & set(sys.modules)
    if code or found:
        sys.exit(f"{name}: code {code}, imports {found}")
"""
    arguments = [sys.executable, "-c", script, "", *(c.name for c in COMMANDS)]
    found = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


def test_help_names_what_a_map_of_the_viewer_shows(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "view", "--help")
    assert code == 0
    assert all(name in out for name in QUANTITIES)


@pytest.mark.parametrize("name", ["machines", "new", "check"])
def test_each_command_has_help_with_examples(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, name, "--help")
    assert code == 0
    assert f"stiffmap {name}" in out
    assert "Examples" in out
    assert "--json" in out


def test_machines(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "machines", "--json")
    assert code == 0
    assert {"orthoglide-revised", "tripteron"} <= {machine["name"] for machine in json.loads(out)}
    code, out, _ = run(capsys, "machines")
    assert code == 0
    assert "orthoglide-original" in out


def test_check(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "check", "tripteron", "--json", "--strict")
    assert code == 0
    data = json.loads(out)
    assert data["counts"] == {"legs": 3, "actuators": 3, "joints": 9, "springs": 6, "blocks": 0, "bodies": 0,
                              "points": 0}  # fmt: skip
    assert data["warnings"] == []
    code, out, _ = run(capsys, "check", "tripteron")
    assert code == 0
    assert "usable" in out


def test_new_then_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(tmp_path / "my machine.yaml")
    assert run(capsys, "new", file)[0] == 0
    assert run(capsys, "check", file, "--strict")[0] == 0
    code, _, err = run(capsys, "new", file)
    assert code == 2
    assert "--overwrite" in err
    assert run(capsys, "new", file, "--overwrite", "--json")[0] == 0


def test_strict_makes_warnings_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m.yaml"
    run(capsys, "new", str(file))
    file.write_text(file.read_text(encoding="utf-8").replace("home: 53.13\n", "home: 53\n"), encoding="utf-8")
    assert run(capsys, "check", str(file))[0] == 0
    code, out, _ = run(capsys, "check", str(file), "--strict")
    assert code == 1
    assert "left by" in out


def test_unwritable(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "new", str(tmp_path / "nowhere" / "m.yaml"))
    assert code == 2
    assert "cannot be written" in err


def test_bad_input_is_one_line_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "check", "tripterom")
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert "did you mean 'tripteron'" in err


def test_usage_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "chek")[0] == 2
    assert run(capsys, "check")[0] == 2


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "--version")
    assert code == 0
    assert out.startswith("stiffmap")


def test_interrupt(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def stop(file: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("stiffmap.ui.cli.check.check_file", stop)
    assert run(capsys, "check", "tripteron")[0] == 130


def test_a_defect_is_one_line_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(file: str) -> None:
        raise ValueError("shapes\n(2,) (3,)")

    monkeypatch.setattr("stiffmap.ui.cli.check.check_file", broken)
    code, _, err = run(capsys, "check", "tripteron")
    assert code == 70 and err.count("\n") == 1
    assert "a defect of stiffmap" in err and "ValueError" in err and "shapes (2,) (3,)" in err
    monkeypatch.setenv("STIFFMAP_TRACEBACK", "1")
    with pytest.raises(ValueError, match="shapes"):
        run(capsys, "check", "tripteron")


def test_missing_parts_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "needs_more.py").write_text("import a_package_that_is_missing\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(MissingPartError, match=r"'stiffmap x' needs a_package_that_is_missing.*pip install"):
        load(Command("x", "needs_more", ""))
    with pytest.raises(MissingPartError, match="installation of stiffmap lacks"):
        load(Command("x", "stiffmap.ui.cli.not_written", ""))


def test_the_package_runs_as_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "stiffmap", "--version"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.strip()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("map five-bar --toolpath trim --points 5", "--points: not with --toolpath"),
        ("map five-bar --statistics --table csv", "--table: not with --statistics"),
        ("map five-bar --statistics --y 350", "--y: not with --statistics"),
        ("sweep five-bar --limit 100 --to 50", "--to: not with --limit"),
        ("map five-bar --no-pictures --format svg", "--format: not without --pictures"),
        ("plan ur10 --taps 3 --rows 8", "--rows: not with --taps"),
        ("plan ur10 --identify x --until 0.1 -o p.csv", "--output: not with --until"),
        ("plan ur10 --identify x --twin y", "--twin: not without --until"),
        ("plan ur10 --identify x --at 0,0,0", "--at: not without --map"),
        ("view ur10 --link a --at 0,0,0", "--at: not with --link"),
        ("view ur10 --html a.html --port 80", "--port: not with --html"),
        ("diagnose ur10 e --date 2026-01-01", "--date: not without --output"),
        ("experiment new t.csv --machine ur10 --dh-convention modified -o e", "--dh-convention: not without --dh"),
        ("import a.urdf --dh-convention standard", "--dh-convention: expected a table with this option"),
        ("import t.csv --tip tool0", "--tip: expected a URDF with this option, found a table"),
        ("view ur10 --picture a.png --experiment e", "--experiment: not with --picture"),
        ("experiment new t.csv --machine ur10 --sheet A -o e", "t.csv: no sheet 'A': a text has none"),
    ],
)  # fmt: skip
def test_options_that_would_not_be_used(
    words: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("t.csv").write_text("x [mm],y [mm]\n1,2\n")
    assert main(words.split()) == 2
    assert message in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["t.csv"]


NO_COUNTS = {"seed", "which", "threads", "processes", "cross", "redundancy", "port"}
"""Whole numbers that say which one, and those of threads and processes."""
LISTED = {("calibrate", "rows"), ("residual", "rows")}
"""How many lines are shown at most, of those that there are."""


def test_every_count_has_a_largest_one() -> None:
    given = [(c.name, *p) for c in COMMANDS for p in signature(load(c)).parameters.items()]
    whole = [(c, n, p) for c, n, p in given if p.annotation in (int, int | None) and n not in NO_COUNTS]
    free = {(c, n) for c, n, p in whole if getattr(p.default, "callback", None) is None}
    assert len(whole) > 15 and free == LISTED


@pytest.mark.parametrize(
    "words",
    [
        "sweep orthoglide-revised --points 1000000000",
        "map orthoglide-revised --points 1000000000",
        "map orthoglide-revised --directions 1000000000",
        "polar orthoglide-revised --directions 1000000000",
        "measures orthoglide-revised --nodes 1000000000",
        "lobes ur10 --process slot --points 1000000000,80",
        "lobes ur10 --process slot --points 120,1e9",
        "simulate orthoglide-revised -o twin --poses 1000000000",
    ],
)
def test_counts_that_nothing_can_hold_are_refused(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, *words.split())
    name = words.split()[-2]
    assert (code, out) == (2, "")
    assert re.fullmatch(rf"stiffmap: {name}: expected at most 10+, got 1000000000\n", err)

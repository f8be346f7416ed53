"""Home configurations that cannot be: one error that says how far each leg is off."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.model.files.shipped import machine_folder
from stiffmap.ui.cli import main

FIVE_BAR = machine_folder() / "five-bar.yaml"


def changed(folder: Path, old: str, new: str) -> Path:
    text = Path(FIVE_BAR).read_text()
    assert text.count(old) == 1
    file = folder / "bad.yaml"
    file.write_text(text.replace(old, new))
    return file


def test_impossible_home(tmp_path: Path) -> None:
    file = changed(tmp_path, "home: -151.92751306414704", "home: 0")
    with pytest.raises(sm.StiffmapError, match=r"home configuration does not close: .*right by \d.* deg"):
        sm.load_machine(file)


def test_check_does_not_call_it_usable(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = changed(tmp_path, "home: -151.92751306414704", "home: 0")
    assert main(["check", str(file)]) == 2
    out, error = capsys.readouterr()
    assert "usable" not in out and error.count("\n") == 1
    assert re.search(r"home configuration does not close: .*right by \d.* deg", error)


def test_wrong_assembly_branch(tmp_path: Path) -> None:
    """The right elbow bent inwards: its leg could reach the tool, but not from these angles."""
    file = changed(tmp_path, "home: 98.79741070999106", "home: -98.79741070999106")
    with pytest.raises(sm.StiffmapError, match=r"home configuration does not close: .*right by \d.* deg"):
        sm.load_machine(file)


def test_nearly_closed_home_is_closed_exactly(tmp_path: Path) -> None:
    rough = sm.load_machine(changed(tmp_path, "home: 98.79741070999106", "home: 98.9"))
    exact = sm.load_machine("five-bar")
    p = exact.description.home.p
    assert rough.solve(p).displacement == pytest.approx(exact.solve(p).displacement, abs=1e-12)
    k = [sm.inverse_kinematics(m, p).actuators for m in (rough, exact)]
    assert k[0] == pytest.approx(k[1], abs=1e-12)


def test_unknown_task(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match=r"task\[1\]"):
        sm.load_machine(changed(tmp_path, "task: [x, y]", "task: [x, w]"))

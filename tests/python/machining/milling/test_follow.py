"""A machine that cannot follow a path is refused, with the directions; one that can is not (docs/milling.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffmap.common.errors import StiffmapError
from stiffmap.machining.compensation import compensate
from stiffmap.machining.milling import mill_job, speed
from stiffmap.machining.milling.placement import placements
from stiffmap.machining.process import load_process
from stiffmap.machining.toolpath import Toolpath, path_of
from stiffmap.solve.machine import load_machine
from stiffmap.ui.cli import main

CUT = load_process("slot")
MISSED = [
    ("3-rps", (0.02, 0, 0), "x"),
    ("3-rps", (0, 0.02, 0.01), "y"),
    ("swing-table", (0, 0.02, 0), "y"),
    ("five-bar", (0.01, 0.02, 0.01), "z"),
    ("swing-table", (0.02, 0, 0), "z"),  # it is carried along a curve
]


def _path(end: tuple[float, float, float], tool: tuple[float, float, float] = (0, 0, 1)) -> Toolpath:
    return path_of([[0, 0, 0], end], feed=CUT.feed, spindle=CUT.spindle, tool=tool)


@pytest.mark.parametrize(("name", "end", "axis"), MISSED)
def test_directions_that_are_missed_are_told(name: str, end: tuple[float, float, float], axis: str) -> None:
    m = load_machine(name)
    with pytest.raises(StiffmapError, match=rf"{name} cannot follow the path: it misses {axis} by up to"):
        mill_job(m, _path(end), CUT)
    with pytest.raises(StiffmapError, match=rf"{name} cannot follow the path: it misses {axis} by up to"):
        placements(m, _path(end), CUT, count=8, points=10)
    home = m.description.home.p
    if end[0] == 0.02 and name == "swing-table":  # its height is as at home: only x is asked for
        assert compensate(m, [home, home + end]).ok.all()
        return
    with pytest.raises(
        StiffmapError, match=rf"{name} cannot take the wanted poses: it misses {axis} .*row 2"
    ):
        compensate(m, [home, home + end])


def test_a_tilt_and_a_turn_that_are_missed() -> None:
    with pytest.raises(StiffmapError, match=r"five-bar cannot follow the path: it misses rx by up to .* deg"):
        mill_job(load_machine("five-bar"), _path((0.02, 0, 0), (0, 0.1, 1)), CUT)
    m = load_machine("five-bar")
    turned = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
    with pytest.raises(StiffmapError, match="misses rx by up to 90 deg"):
        compensate(m, [m.description.home.p], [turned])


@pytest.mark.parametrize("name", ["five-bar", "travelling-column", "hybrid"])
def test_paths_within_the_task_are_followed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "PLACES", 1)  # of chatter, which is not asked for here
    monkeypatch.setattr(speed, "SPEEDS", 3)
    m = load_machine(name)
    found = mill_job(m, _path((0.02, 0, 0)), CUT)
    assert np.abs(found.dataset.error_normal_after).max() < 0.1 * np.abs(found.dataset.error_normal).max()
    steered = np.array([axis in m.description.task for axis in "xyz"])
    assert not (found.command - found.job.position)[:, ~steered].any()
    # the bend out of the plane is left, and said
    s = m.solve(
        found.command,
        np.hstack([found.job.force(np.zeros((len(found.job), 2))), np.zeros((len(found.job), 3))]),
    )
    left = np.linalg.norm((found.command + s.displacement[:, :3] - found.job.position), axis=1)
    np.testing.assert_allclose(found.dataset.command_left, left, atol=1e-10)
    assert np.isfinite(placements(m, _path((0.02, 0, 0)), CUT, count=2, points=3).best_error)


def test_commands_refuse(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    motion.write_text(
        "t [s],x [mm],y [mm],z [mm]\n" + "".join(f"{k},{2 * k},416,{min(k, 9)}\n" for k in range(12))
    )
    assert main(["map", "five-bar", "--toolpath", str(motion), "-o", str(tmp_path)]) == 2
    assert "it misses z by up to 9 mm" in capsys.readouterr().err
    assert main(["mill", "3-rps", "circle", "--size", "20", "--process", "slot"]) == 2
    assert "it commands z, rx, ry" in capsys.readouterr().err

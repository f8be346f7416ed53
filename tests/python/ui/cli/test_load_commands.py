"""`stiffmap wrench`, `stress` and `sweep --limit`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli import main


def test_wrench(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["wrench", "hexapod", "--at", "50,0,700", "--by", "0,0,-0.1", "--turn", "0,0.01,0", "--json"])
        == 0
    )
    got = json.loads(capsys.readouterr().out)
    held = sm.load_machine("hexapod").wrench([0.05, 0, 0.7], [0, 0, -1e-4, 0, np.deg2rad(0.01), 0])
    np.testing.assert_allclose(got["wrench"], held.wrench, atol=1e-6)
    assert set(got["leg_wrench"]) == set("123456")
    assert got["status"] == "CONVERGED" == got["status_without_clamp"]
    assert main(["wrench", "hexapod", "--by", "0,0,-0.1"]) == 0
    assert "leg 6 on platform: force (" in capsys.readouterr().out


def test_wrench_out_of_reach(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wrench", "five-bar", "--at", "2000,0,0", "--json"]) == 1
    got = json.loads(capsys.readouterr().out)
    assert got["status"] == "UNREACHABLE" and got["wrench"] == [None] * 6


def test_stress(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stress", "swing-table", "--gravity", "0,0,-10", "-o", str(tmp_path), "--json"]) == 0
    got = json.loads(capsys.readouterr().out)
    for name in ("front_left", "front_right", "back_left", "back_right"):
        assert got["springs"][f"{name}.bar"][2] == pytest.approx(-30, rel=1e-4)
    assert (tmp_path / "stress.png").stat().st_size > 1000
    assert main(["stress", "swing-table"]) == 0
    assert "front_left.bar" in capsys.readouterr().out


def test_path_finds_the_rods_that_buckle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A rod on ball joints with one spring at its end buckles at 3 EI / L^2."""
    call = ["sweep", "linear-delta", "--direction", "0,0,-1", "--limit", "8000", "--points", "10"]
    assert main([*call, "-o", str(tmp_path), "--json"]) == 1
    got = json.loads(capsys.readouterr().out)
    rod = 3 * 1.2e11 * np.pi * (0.014**4 - 0.012**4) / 64 / 0.5**2
    assert got["critical_force"][0] == pytest.approx(6 * 0.8 * rod, rel=2e-3)
    assert got["critical_kind"][0] == "bifurcation"
    assert (tmp_path / "path.png").exists() and (tmp_path / "mode_1.png").exists()
    assert main(call) == 1
    assert "bifurcation point at" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["wrench", "hexapod", "--by", "1,2"], "--by: expected 3 numbers"),
        (
            ["sweep", "hexapod", "--limit", "9", "--points", "2", "--cross", "1"],
            "cross: the path has 0 bifurc",
        ),
        (["sweep", "hexapod", "--control", "arc"], "limit: expected a number other than 0 (m"),
        (["sweep", "hexapod", "--control", "fast", "--limit", "1"], "control: expected one of force"),
        (["stress", "hexapod", "--at", "a,b,c"], "--at: expected 3 numbers"),
    ],
)
def test_bad_input(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1

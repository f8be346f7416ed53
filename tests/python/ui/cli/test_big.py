"""`stiffmap map --estimate` and `--statistics`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    code = main(["map", "orthoglide-revised", *words])
    return code, capsys.readouterr().out


def test_an_estimate_solves_no_map(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out = run(capsys, "--points", "2001", "--estimate")
    assert code == 0
    assert out.startswith("12,012,003 poses: about ")
    assert list(tmp_path.iterdir()) == []


def test_statistics_agree_with_the_map(capsys: pytest.CaptureFixture[str]) -> None:
    code, out = run(capsys, "--points", "5", "--statistics", "--json", "--force", "200")
    assert code == 0
    rows = json.loads(out)["rows"]
    assert [r["force"] for r in rows[:4]] == ["worst", "best", "Fx", "Fy"]
    axis = np.linspace(-0.2, 0.3, 5)
    ds = sm.error_map(
        sm.load_machine("orthoglide-revised"), x=axis, y=axis, z=-0.2, wrench=[200.0, 0, 0, 0, 0, 0]
    )
    assert rows[0]["max"] == float(ds.worst_deflection_xy.max())
    assert rows[2]["max"] == float(ds.deflection_xy.max())


@pytest.mark.parametrize("force", ["200,0,-100", "200,100,0"])
def test_statistics_read_the_deflection_that_the_table_of_the_map_reads(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, force: str
) -> None:
    """A force out of the plane is judged by its deflection in space, in both."""
    words = ("--points", "3", "--force", force, "--z", "0")
    _, stored = run(capsys, *words, "--no-pictures", "--json", "-o", str(tmp_path))
    _, figures = run(capsys, *words, "--statistics", "--json")
    keys = ("force", "z", "max")
    tables = [[[r[k] for k in keys] for r in json.loads(text)["rows"]] for text in (stored, figures)]
    assert tables[0] == tables[1]
    assert ("|d|" in run(capsys, *words, "--statistics")[1]) == (force == "200,0,-100")


def test_statistics_are_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    code, out = run(capsys, "--points", "5", "--statistics", "--z", "0")
    assert code == 0
    assert "at x, y" in out
    assert "300, 300" in out

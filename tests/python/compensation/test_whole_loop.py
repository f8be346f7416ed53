"""Readings, diagnosis, corrected machine, compensated commands, error after: the commands of docs/planning.md."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.cli.app import main


def test_a_cause_that_nobody_suspects_is_compensated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = "length bar x error=0.1mm"
    readings, held_out, result = (str(tmp_path / n) for n in ("readings", "held_out", "result"))
    twin = ["simulate", "orthoglide-revised", "--quantity", "position", "--poses", "30", "--effect", truth]
    assert main([*twin, "-o", readings]) == 0
    assert main([*twin, "--seed", "7", "-o", held_out]) == 0
    assert main(["diagnose", "orthoglide-revised", readings, "-o", result]) == 1  # effects were found
    (tmp_path / "poses.csv").write_text("x,y,z\n50,0,20\n-80,60,0\n")
    capsys.readouterr()
    commands = ["compensate", f"{result}/machine.yaml", str(tmp_path / "poses.csv"), "--check", held_out]
    assert main([*commands, "-o", str(tmp_path / "commands.csv"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    sigma = 1e3 * np.nanmean(sm.load_experiment(held_out).sigma)
    assert said["rms left by compensation, mm"] < 1.1 * sigma < 0.3 * said["rms as measured, mm"]

    table = np.genfromtxt(tmp_path / "commands.csv", delimiter=",", names=True)
    commanded = np.column_stack([table[f"pose_{a}_mm"] for a in "xyz"]) / 1e3
    real = sm.load_machine("orthoglide-revised").with_effect("length", element="bar", legs=["x"], error=1e-4)
    wanted = np.array([[0.05, 0.0, 0.02], [-0.08, 0.06, 0.0]])
    error = commanded + real.solve(commanded).displacement[:, :3] - wanted
    assert np.abs(error).max() < 5e-6 < 0.1 * np.abs(real.solve(wanted).displacement[:, :3]).max()

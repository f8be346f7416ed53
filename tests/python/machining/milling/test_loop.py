"""The loop of docs/milling.md: a machine with an effect that its file does not declare; readings, diagnosis, program, part."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.machining.milling import mill_job, sizes
from stiffmap.ui.cli import main

JOB = ["washbasin", "--process", "trimming", "--at", "50,50,0", "--step"]


def test_program_of_the_corrected_machine_on_the_true_one() -> None:
    """What the diagnosis is for: with the effect known the part is right, without it it is not."""
    declared = sm.load_machine("orthoglide-revised")
    true = declared.with_effect("length", element="bar", legs=["x"], error=0.2e-3)
    left = {}
    for name, machine in (("declared", declared), ("known", true)):
        ds = mill_job(
            machine, "washbasin", "trimming", at=(0.05, 0.05, 0), step=5e-3, true_machine=true
        ).dataset
        left[name] = sizes(ds.true_error_normal_after)["largest"]
        left["as it is"] = sizes(ds.true_error_normal)["largest"]
    assert left["declared"] > 0.1
    assert left["known"] < 0.01 * left["as it is"]


def test_play_is_closed_by_the_load_and_known_to_the_program() -> None:
    """The corrected machine's program meets the wall on a machine with play, the declared one's is off by the play."""
    from tests.python.machining.milling.gantry import gantry

    from stiffmap.machining.toolpath import path_of

    declared, play = gantry(), 30e-6
    true = declared.with_effect("dead_zone", element="y", legs=["arm"], half_width=play)
    path = path_of([[-0.05, 0, 0], [0.05, 0, 0]])
    left = {}
    for name, machine in (("declared", declared), ("known", true)):
        ds = mill_job(machine, path, "trimming", at=(0, 0, 0), true_machine=true).dataset
        left[name] = ds.true_error_normal_after.values
    gain = float(mill_job(declared, path, "trimming", at=(0, 0, 0)).dataset.gain[0])
    assert left["declared"][3:-3] == pytest.approx(play / (1 + gain), rel=0.02)
    assert sizes(left["known"])["largest"] < 0.001


def test_friction_stays_on_the_side_of_the_travel() -> None:
    """A drive that travels lags by friction over stiffness: another error on the way there than on the way back."""
    from tests.python.machining.milling.gantry import gantry

    from stiffmap.machining.toolpath import path_of

    machine = gantry().with_effect("friction", element="x", legs=["arm"], force=20.0)
    there = path_of([[-0.05, 0, 0], [0.05, 0, 0]])
    back = path_of([[0.05, 0, 0], [-0.05, 0, 0]])
    plain, process = gantry(), sm.load_process("trimming")
    for path, sign in ((there, -1.0), (back, 1.0)):
        lag = (
            mill_job(machine, path, process, at=(0, 0, 0)).dataset.error.values[3, 0]
            - mill_job(plain, path, process, at=(0, 0, 0)).dataset.error.values[3, 0]
        )
        assert lag == pytest.approx(sign * 20.0 * 1e-6, rel=1e-6)


def test_from_readings_to_the_part_with_play(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Loads up and down find the play of a drive; the program of the diagnosed machine takes it up."""
    readings, result, true = str(tmp_path / "readings"), tmp_path / "result", tmp_path / "true.yaml"
    plan = ["--branches", "--loads", "full", "--poses", "5"]
    effect = ["--effect", "dead_zone actuator y half_width=60um"]
    assert main(["simulate", "orthoglide-revised", *effect, *plan, "-o", readings]) == 0
    main(["diagnose", "orthoglide-revised", readings, "-o", str(result)])
    assert (
        result / "report.html"
    ).exists()  # without a picture of the machine that has no state of its own without load
    play = sm.load_machine("orthoglide-revised").with_effect(
        "dead_zone", element="actuator", legs=["y"], half_width=60e-6
    )
    play.save(true)
    capsys.readouterr()
    said = {}
    for name, machine in (("declared", "orthoglide-revised"), ("diagnosed", str(result / "machine.yaml"))):
        main(["mill", machine, *JOB, "5", "--true", str(true), "--json"])
        said[name] = json.loads(capsys.readouterr().out)
    assert said["declared"]["true_error_normal_after_mm"]["rms"] > 0.02
    assert (
        said["diagnosed"]["true_error_normal_after_mm"]["rms"]
        < 0.1 * said["declared"]["true_error_normal_after_mm"]["rms"]
    )


def test_from_readings_to_the_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Simulated readings with 5 µm of noise find the bar that is 0.2 mm too long."""
    readings, result, true = str(tmp_path / "readings"), tmp_path / "result", tmp_path / "true.yaml"
    effect = ["--effect", "length bar x error=0.2mm"]
    plan = ["--quantity", "position", "--plan", "grid:3x3x3", "--noise", "0.005"]
    assert main(["simulate", "orthoglide-revised", *effect, *plan, "-o", readings]) == 0
    main(["diagnose", "orthoglide-revised", readings, "-o", str(result)])
    sm.load_machine("orthoglide-revised").with_effect("length", element="bar", legs=["x"], error=0.2e-3).save(
        true
    )
    capsys.readouterr()
    said = {}
    for name, machine in (("declared", "orthoglide-revised"), ("diagnosed", str(result / "machine.yaml"))):
        main(["mill", machine, *JOB, "20", "--true", str(true), "--json"])
        said[name] = json.loads(capsys.readouterr().out)
    before = said["declared"]["true_error_normal_mm"]["largest"]
    assert before > 0.25
    assert said["declared"]["true_error_normal_after_mm"]["largest"] > 0.1
    assert said["diagnosed"]["true_error_normal_after_mm"]["largest"] < 0.02 * before

"""``stiffmap simulate``, ``residual`` and ``diagnose`` as a user runs them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli.app import main

from .conftest import Twin

SLACK = "dead_zone actuator y half_width=12um"


def test_a_residual_on_disk(tmp_path: Path, twin: Twin, capsys: pytest.CaptureFixture[str]) -> None:
    e = twin("--effect", SLACK, "--poses", "5", "--loads", "full", "--branches", "--temperature", "20,21",
             "--setups", "2", "--joint", "x.proximal", "--outliers", "0.02", "--seed", "4")  # fmt: skip
    capsys.readouterr()
    assert main(["residual", "orthoglide-revised", str(tmp_path / "twin"), "-o", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().out
    for words in (
        "dx: rms",
        "q_x_proximal: rms",
        "mrad",
        "noise",
        "linearity",
        "hysteresis",
        "worst rows",
    ):
        assert words in told
    names = {p.name for p in (tmp_path / "out").iterdir()}
    pictures = {f"residual_{n}.png" for n in ("vectors", "pose", "force", "history")}
    assert names == {"residual.csv", "residual.json", *pictures}
    with (tmp_path / "out" / "residual.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [r["id"] for r in table] == list(e.ids)
    for row in table[::50]:
        left = float(row["dy_mm"]) - float(row["dy_predicted_mm"])
        assert float(row["dy_residual_mm"]) == pytest.approx(left, abs=1e-9)
    data = json.loads((tmp_path / "out" / "residual.json").read_text())
    assert data["set_aside"] == [r["id"] for r in table if r["set_aside"]]
    assert {c["name"]: c["p"] for c in data["checks"]}["linearity"] < 1e-6


def test_json_is_the_same(tmp_path: Path, twin: Twin, capsys: pytest.CaptureFixture[str]) -> None:
    twin("--poses", "4", "--loads", "6")
    capsys.readouterr()
    assert main(["residual", "orthoglide-revised", str(tmp_path / "twin"), "--json", "--rows", "3"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert len(data["worst"]) == 3
    assert data["summary"]["n"] == 4 * 6 * 2 * 3
    assert data["lack_of_fit"] > 1e-3


def test_an_effect_may_be_tried(tmp_path: Path, twin: Twin, capsys: pytest.CaptureFixture[str]) -> None:
    twin("--effect", SLACK, "--poses", "5", "--loads", "axes")
    folder = str(tmp_path / "twin")
    assert main(["residual", "orthoglide-revised", folder]) == 1
    assert main(["residual", "orthoglide-revised", folder, "--effect", SLACK]) == 0


def test_a_plan_as_csv(tmp_path: Path, twin: Twin) -> None:
    plan = tmp_path / "poses.csv"
    plan.write_text(
        "id,x,y,z,fx,mz,temperature,branch,setup\n"
        "a,10,20,30,400,0,20,loading,S1\nb,10,20,30,0,5000,21,unloading,S1\nc,-50,0,0,400,0,22,loading,S2\n"
    )
    e = twin("--plan", str(plan), "--noise", "0.001", "--read", "dx,rz")
    assert e.ids == ("a", "b", "c") and e.axes == ("dx", "rz")
    assert e.wrench[1].tolist() == [0, 0, 0, 0, 0, 5.0]
    assert e.branch == ("loading", "unloading", "loading") and e.setup == ("S1", "S1", "S2")
    assert e.sigma[0, 0] == pytest.approx(1e-6)
    np.testing.assert_allclose(e.position[2], [-0.05, 0, 0])


def test_a_grid_is_just_inside_the_workspace(twin: Twin, orthoglide: sm.Machine) -> None:
    e = twin("--plan", "grid:3x2x1", "--quantity", "position", "--repeats", "1")
    assert len(e) == 6
    low, high = orthoglide.workspace
    assert len(set(e.position[:, 0])) == 3 and set(e.position[:, 2]) == {0.05}
    assert ((e.position > low) & (e.position < high)).all()


def test_an_experiment_may_be_repeated(tmp_path: Path, twin: Twin) -> None:
    first = twin("--poses", "3", "--loads", "4", "--zero-noise", "0.002")
    again = twin("--plan", str(tmp_path / "twin"), "--seed", "5", folder="again")
    np.testing.assert_array_equal(first.position, again.position)
    np.testing.assert_allclose(first.zero_sigma, again.zero_sigma)
    assert np.abs(first.reading - again.reading)[:, :3].min() > 0


def test_seeds_repeat(twin: Twin) -> None:
    one, two = (twin("--poses", "3", "--seed", "7", folder=f) for f in ("one", "two"))
    np.testing.assert_array_equal(one.reading, two.reading)


def test_wild_rows_are_as_many_as_asked(twin: Twin, orthoglide: sm.Machine) -> None:
    from stiffmap.experiment import residual

    e = twin("--poses", "30", "--loads", "9", "--outliers", "0.03")
    assert 5 <= residual(orthoglide, e).set_aside.sum() <= 30


def test_random_order_keeps_poses_together(twin: Twin) -> None:
    e = twin("--poses", "6", "--loads", "3", "--shuffle")
    assert e.order is not None
    changes = np.flatnonzero(np.diff(e.groups[np.argsort(e.order)]))
    assert len(changes) == 5
    assert list(e.groups) != sorted(e.groups)


def test_a_diagnosis_on_disk(tmp_path: Path, twin: Twin, capsys: pytest.CaptureFixture[str]) -> None:
    twin("--effect", "compliance actuator z scale=2", "--poses", "8", "--loads", "6", "--noise", "0.003")
    capsys.readouterr()
    assert main(["diagnose", "orthoglide-revised", str(tmp_path / "twin"), "-o", str(tmp_path / "out")]) == 1
    lines = capsys.readouterr().out.strip().splitlines()
    assert len(lines) <= 8
    assert lines[0].startswith("verdict: effects") and lines[-1].endswith("start with report.html")
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names >= {"diagnosis.json", "report.html", "machine.yaml"}
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [(x["kind"], x["element"], x["legs"]) for x in data["effects"]] == [
        ("compliance", "actuator", ["z"])
    ]
    corrected = sm.load_machine(tmp_path / "out" / "machine.yaml")
    assert [r.kind for r in corrected.description.effects] == ["compliance"]


@pytest.mark.parametrize("command", ["simulate", "residual", "diagnose"])
def test_help_has_examples(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    assert f"stiffmap {command} orthoglide-revised" in capsys.readouterr().out


def test_distances_and_encoders_are_diagnosed(tmp_path: Path, twin: Twin) -> None:
    twin("--quantity", "position", "--poses", "25", "--distances", "--joint", "x.actuator", "--noise", "0.002",
         "--effect", "length bar y error=0.2mm")  # fmt: skip
    assert main(["diagnose", "orthoglide-revised", str(tmp_path / "twin"), "-o", str(tmp_path / "out")]) == 1
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    (effect,) = data["effects"]
    assert (effect["kind"], effect["element"], effect["legs"]) == ("length", "bar", ["y"])
    assert effect["parameters"]["error"][1] < 2e-4 < effect["parameters"]["error"][2]
    assert not (tmp_path / "out" / "residual_vectors.png").exists()

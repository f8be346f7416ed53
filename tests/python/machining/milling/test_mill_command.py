"""`stiffmap mill` and `sm.mill`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.machining.toolpath import load_path, outline_text
from stiffmap.ui.cli import main

ORTHOGLIDE = ["--process", "trimming", "--at", "50,50,0"]


def test_outline_to_report_and_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "outline.ngc"
    source.write_text(outline_text("washbasin", feed=0.08))
    out = tmp_path / "result"
    code = main(
        [
            "mill",
            "orthoglide-revised",
            str(source),
            *ORTHOGLIDE,
            "--turn",
            "10",
            "--band",
            "-o",
            str(out),
            "--json",
        ]
    )
    said = json.loads(capsys.readouterr().out)
    assert code == 0
    before, after = said["error_normal_mm"], said["error_normal_after_mm"]
    assert after["largest"] < 0.02 * before["largest"]
    assert after["rms"] < 0.01 * before["rms"]
    assert said["mirror_leaves_mm"]["largest"] > 2 * after["largest"]
    page = (out / "report.html").read_text()
    assert said["verdict"] in page
    assert said["part_lies"].split("`")[0] in page
    force = [f"{said['force_N'][k]:.3g}" for k in ("least", "largest")]
    assert f"Along the path as simulated: feed 4.8 m/min, force {force[0]} to {force[1]} N." in page
    assert "At the process file&#39;s own feed (6 m/min), speed and cut the mean force would be" in page
    assert page.count("data:image/png") == 3
    assert "http" not in page.replace("http://www.w3.org", "")
    program = load_path(out / "compensated.ngc")
    assert len(program.cuts) > 10
    ds = sm.mill("orthoglide-revised", source, "trimming", at=(0.05, 0.05, 0.0), turn=np.radians(10))
    assert 1e3 * float(np.abs(ds.error_normal).max()) == pytest.approx(before["largest"])
    assert set(ds.dims) >= {"point", "axis", "actuator"}


def test_findings_and_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = ["linear-delta", "circle", "--size", "60", "--process", "trimming", "--at", "50,50,300"]
    assert main(["mill", *small, "--tolerance", "0.000001", "--step", "5"]) == 1
    assert "beyond it compensated" in capsys.readouterr().out
    assert main(["mill", *small]) == 0
    out = capsys.readouterr().out
    assert "warnings" not in out
    assert (
        "part_lies: Seen from the spindle the outline is travelled clockwise; in a climb cut the part lies inside it."
        in out
    )
    assert main(["mill", *small[:-2]]) == 1  # at the machine's home its drives are too weak
    assert "The drive effort is broken at 12 of" in capsys.readouterr().out
    assert (
        main(["mill", *small, "--entry", "best", "--feeds", "--tolerance", "0.1", "--reverse", "--json"]) == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert said["entry"]["step_there_mm"] <= said["entry"]["step_as_given_mm"]
    assert said["feeds"]["held"]
    assert said["error_normal_mm"]["largest"] <= 0.1 * (1 + 1e-6)
    for wrong, message in (
        (["--stock", "1,2,3"], "--stock"),
        (["--stock=0,0,0,-1,1,1"], "stock: expected two corners"),
        (["--entry", "1000"], "entry: expected 0 to"),
        (["--tolerance", "0"], "tolerance: expected"),
        (["--offset", "G60=1"], "--offset"),
        (["--at", "1,2"], "--at"),
        (["--size", "1,2"], "size"),
    ):
        assert main(["mill", *small, *wrong]) == 2
        said = capsys.readouterr()
        assert message in said.err
        assert len(said.err.splitlines()) == 1


def test_python_does_what_the_command_does(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--size", "60", "--process", "trimming", "--at", "50,50,0", "--step", "5", "--json"]
    more = ["--entry", "best", "--reverse", "--tolerance", "0.1"]
    assert main(["mill", "orthoglide-revised", "circle", *asked, *more]) == 0
    said = json.loads(capsys.readouterr().out)
    ds = sm.mill(
        "orthoglide-revised", "circle", "trimming", at=(0.05, 0.05, 0), size=(0.06,), step=5e-3,
        entry="best", reverse=True, tolerance=1e-4,
    )  # fmt: skip
    assert ds.attrs["verdict"] == said["verdict"]
    assert 1e3 * ds.attrs["entry"] == pytest.approx(said["entry"]["way_mm"])
    assert ds.attrs["tolerance"] == 1e-4
    assert ds.attrs["program"].count("\n") > 10
    with pytest.raises(sm.StiffmapError, match="entry: expected a length"):
        sm.mill("orthoglide-revised", "circle", "trimming", entry="first")
    with pytest.raises(sm.StiffmapError, match="stock: expected two corners"):
        sm.mill("orthoglide-revised", "circle", "trimming", stock=[1, 2, 3])
    with pytest.raises(sm.StiffmapError, match="offset: expected names from G54 to G59; got 'G60'"):
        sm.mill("orthoglide-revised", "circle", "trimming", offset={"G60": (0.01, 0, 0)})
    placed = sm.mill("linear-delta", "circle", "trimming", size=(0.06,), step=8e-3, place=4)
    assert "placements the best leaves" in placed.attrs["placement"]


def test_python_turns_the_tool_of_an_arm() -> None:
    where = {"at": (-0.7, -0.05, 0.3), "size": (0.06,), "step": 8e-3}
    turned = sm.mill("ur10", "circle", "trimming", redundancy=12, **where)
    assert turned.angle.shape == turned.way.shape
    fixed = sm.mill("ur10", "circle", "trimming", **where)
    assert float(abs(turned.error_normal).max()) <= float(abs(fixed.error_normal).max()) * (1 + 1e-6)
    with pytest.raises(sm.StiffmapError, match="size, offset"):
        sm.mill("ur10", load_path("circle"), "trimming", size=(0.06,))

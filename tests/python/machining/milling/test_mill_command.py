"""`stiffmap mill` and `sm.mill`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry

import stiffmap as sm
from stiffmap.machining.milling import mill_job
from stiffmap.machining.toolpath import load_path, outline, outline_text
from stiffmap.ui.cli import main
from stiffmap.ui.plot.milling import outline_figure
from stiffmap.workspace.maps.loading import machine_digest

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
    assert f"sha256 {machine_digest(sm.load_machine('orthoglide-revised'))}" in page  # as in its map
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


@pytest.mark.parametrize(("side", "corner"), [("climb", "outside"), ("conventional", "inside")])
def test_the_picture_of_an_outline_has_true_corners(side: str, corner: str) -> None:
    process = sm.load_process("trimming")
    process = replace(process, cut=replace(process.cut, side=side))
    square = outline("rectangle", (0.08, 0.06, 0.0))  # clockwise
    figure = outline_figure(mill_job(gantry(), square, process, at=(0, 0, 0), step=5e-3))
    ax = figure.axes[0]
    wanted, compensated = ax.lines
    assert [wanted.get_label(), compensated.get_label()] == ["wanted", "compensated"]
    half = np.array([40.0, 30.0]) + (-6 if corner == "outside" else 6)
    x, y = np.abs(np.asarray(wanted.get_xydata()).T)
    assert np.max([x, y], axis=1) == pytest.approx(half)
    if corner == "outside":  # all on the walls, and the four corners themselves
        assert np.minimum(np.abs(x - half[0]), np.abs(y - half[1])) == pytest.approx(0, abs=1e-9)
        assert np.any(np.hypot(x - half[0], y - half[1]) < 1e-9)
    else:  # the tool's rounding of 6 mm
        round_ = (x > 40 + 1e-6) & (y > 30 + 1e-6)
        assert np.hypot(x - 40, y - 30)[round_] == pytest.approx(6)
        assert round_.sum() > 4 * 10
    assert (np.isnan(np.asarray(compensated.get_xydata())).any(axis=1)).sum() >= 4  # no line across a corner


def test_the_picture_has_no_line_between_cuts(tmp_path: Path) -> None:
    file = tmp_path / "two.ngc"
    lift = "G0 Z5\nX0 Y20\nG1 Z0"
    file.write_text(f"G21 G90 G17 G94\nS12000 M3\nG0 X0 Y0 Z5\nG1 Z0 F1000\nX30\n{lift}\nX30\nG0 Z5\nM2\n")
    found = mill_job(gantry(), file, "trimming", at=(0, 0, 0), step=5e-3)
    for line in outline_figure(found).axes[0].lines:
        y = np.asarray(line.get_ydata())
        assert np.nanmax(np.abs(np.diff(y))) < 1
        assert np.nanmax(y) - np.nanmin(y) > 19


def test_python_does_what_the_command_does(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--size", "20", "--process", "trimming", "--at", "50,50,0", "--step", "10", "--json"]
    more = ["--entry", "best", "--reverse", "--tolerance", "0.1"]
    assert main(["mill", "orthoglide-revised", "circle", *asked, *more]) == 0
    said = json.loads(capsys.readouterr().out)
    ds = sm.mill(
        "orthoglide-revised", "circle", "trimming", at=(0.05, 0.05, 0), size=(0.02,), step=0.01,
        entry="best", reverse=True, tolerance=1e-4,
    )  # fmt: skip
    assert ds.attrs["verdict"] == said["verdict"]
    assert 1e3 * ds.attrs["entry"] == pytest.approx(said["entry"]["way_mm"])
    assert ds.attrs["tolerance"] == 1e-4
    assert ds.attrs["program"].count("\n") > 10
    with pytest.raises(sm.StiffmapError, match="entry: expected a number or 'best', got 'first'"):
        sm.mill("orthoglide-revised", "circle", "trimming", entry="first")
    with pytest.raises(sm.StiffmapError, match="stock: expected two corners"):
        sm.mill("orthoglide-revised", "circle", "trimming", stock=[1, 2, 3])
    with pytest.raises(sm.StiffmapError, match="offset: expected names from G54 to G59; got 'G60'"):
        sm.mill("orthoglide-revised", "circle", "trimming", offset={"G60": (0.01, 0, 0)})
    placed = sm.mill("linear-delta", "circle", "trimming", size=(0.02,), step=0.01, place=2)
    assert "placements the best leaves" in placed.attrs["placement"]


def test_python_turns_the_tool_of_an_arm() -> None:
    where = {"at": (-0.7, -0.05, 0.3), "size": (0.06,), "step": 8e-3}
    turned = sm.mill("ur10", "circle", "trimming", redundancy=12, **where)
    assert turned.angle.shape == turned.way.shape
    fixed = sm.mill("ur10", "circle", "trimming", **where)
    assert float(abs(turned.error_normal).max()) <= float(abs(fixed.error_normal).max()) * (1 + 1e-6)
    with pytest.raises(sm.StiffmapError, match="size, offset"):
        sm.mill("ur10", load_path("circle"), "trimming", size=(0.06,))


def test_the_documentation_says_first_what_the_shipped_process_cuts() -> None:
    text = (Path(__file__).parents[4] / "docs/milling.md").read_text(encoding="utf-8")
    begin = text[: text.index("## A process")]
    for word in ("edge", "composite part", "diamond-coated tool"):
        assert word in sm.load_process("trimming").title
        assert word in begin


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["circle", "--offset", "G54=100,0,0"], "circle: offsets: only a program in G-code takes them"),
        (
            ["points.csv", "--offset", "G54=100,0,0"],
            "points.csv: offsets: only a program in G-code takes them",
        ),
        (["part.ngc", "--offset", "G54=1,0,0", "--offset", "G54=2,0,0"], "each name once; got 'G54=2,0,0'"),
        (["circle", "--within", "-1"], "--within"),
    ],
)
def test_what_would_be_dropped_is_refused(words, message, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mill", "orthoglide-revised", *words, *ORTHOGLIDE]) == 2
    assert message in capsys.readouterr().err

"""What is chosen stands in the written program: feeds, an arm's turn, work offsets, the entry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling import mill_job, sizes
from stiffmap.machining.milling.choices import best_entry
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.setting import setting
from stiffmap.machining.toolpath import box, load_path, outline, sampled
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.outlines import entered_at

ARM = Path(__file__).parents[4] / "examples/ur10-spindle.yaml"
TEXT = """G21 G90 G17
S18000 M3
F3000
G0 X-40 Y0 Z5
G1 Z0
G1 X40 (first) F6000
G1 Y-30 ; second
G20
G1 X-1.5748 F200
G21
G0 Z5
M2
"""


def test_feeds_that_hold_the_tolerance_are_written() -> None:
    path = load_gcode(TEXT.splitlines(), name="p")
    machine = gantry(x=4e-4, y=1e-3)
    found = mill_job(machine, path, "trimming", at=(0, 0, 0), feeds=True)
    assert found.feeds is not None
    assert found.feeds.held.all()
    made = found.program.path
    for move in np.flatnonzero(path.cuts):
        mine = found.program.origin == move
        assert made.feed[mine] == pytest.approx(found.feeds.feed[move], rel=1e-5)
        assert found.feeds.feed[move] != pytest.approx(path.feed[move], rel=1e-3)
    assert made.feed[1] == pytest.approx(path.feed[1])  # the plunge keeps its own
    assert "(first)" in found.program.text
    assert "; second" in found.program.text
    limit = found.job.process.tolerance
    assert limit is not None
    assert float(np.abs(found.dataset.error_normal).max()) <= limit * (1 + 1e-6)
    after = np.abs(found.dataset.error_normal_after.values)
    assert np.median(after) < 0.002  # the joint at the corner aside


def test_an_arm_runs_its_turn_from_the_program() -> None:
    machine, path = sm.load_machine(ARM), outline("washbasin")
    at, step = (-0.75, -0.1, 0.3), 0.02
    points = sampled(path, step)
    angle = np.radians(-80 + 40 * np.sin(2 * np.pi * points.way / points.way[-1]))
    found = mill_job(machine, path, "trimming", at=at, step=step, angle=angle)
    made = found.program.path
    assert made.turn is not None
    assert "C" in found.program.text
    run = found.after.job
    assert run.angle is not None
    assert run.angle == pytest.approx(np.interp(run.points.way, points.way, angle), abs=2e-3)
    assert sizes(found.dataset.error_normal_after)["rms"] < 0.03 * sizes(found.dataset.error_normal)["rms"]
    # at home's turn the same commands are wrong
    flat = load_gcode(
        [" ".join(w for w in line.split() if w[0] != "C") for line in found.program.text.splitlines()]
    )
    home = setting(machine, flat, found.job.process, sampled(flat, step), found.job.place)
    turned = setting(machine, made, found.job.process, sampled(made, step), found.job.place)
    assert home.angle is None
    assert turned.angle is not None
    # the tool turns before it goes down
    assert made.turn[0] == pytest.approx(angle[0], abs=1e-5)
    with pytest.raises(
        StiffmapError, match=r"turns the tool about its axis .* linear-delta has no such motion"
    ):
        mill_job(sm.load_machine("linear-delta"), made, "trimming", at=(0, 0, 0.3))


def test_a_table_holds_the_turn(tmp_path: Path) -> None:
    rows = ["x_mm,y_mm,z_mm,turn_deg"] + [f"{x},0,0,{-80 + x / 4}" for x in range(0, 90, 10)]
    file = tmp_path / "p.csv"
    file.write_text("\n".join(rows) + "\n")
    path = load_path(file)
    found = mill_job(sm.load_machine(ARM), path, "trimming", at=(-0.75, -0.1, 0.3), step=1.0)
    assert found.job.angle is not None
    assert np.degrees(found.job.angle[-1]) == pytest.approx(-60)
    out = tmp_path / "out.csv"
    out.write_text(found.program.text)
    again = load_path(out)
    assert again.turn is not None
    assert np.degrees(again.turn[-1]) == pytest.approx(-60)


def test_programs_keep_their_work_offsets(tmp_path: Path) -> None:
    """The controller adds the offset to what is written, as it does to what was read."""
    file = tmp_path / "p.ngc"
    file.write_text("G21 G90 G55 S18000 M3\nG0 X0 Y0\nG1 X20 F6000\nM2\n")
    offsets = {"G54": (0.0, 0, 0), "G55": (0.1, 0.02, 0)}
    path = load_path(file, offsets=offsets)
    found = mill_job(gantry(), path, "trimming", at=(0, 0, 0))
    text = found.program.text
    bare = load_gcode(text.splitlines())
    first = np.flatnonzero(bare.cuts)[0]
    assert 1e3 * bare.start[first] == pytest.approx([0, 0, 0], abs=0.5)
    assert found.program.path.start[first] == pytest.approx(
        bare.start[first] + np.array([0.1, 0.02, 0]), abs=1e-9
    )
    assert sizes(found.dataset.error_normal_after)["largest"] < 0.002


def test_the_best_entry_leaves_the_least_step() -> None:
    machine, path = sm.load_machine("orthoglide-revised"), outline("washbasin")
    process = sm.load_process("trimming")
    job = setting(machine, path, process, sampled(path, 5e-3), path.placed((0.05, 0.05, 0)))
    best = best_entry(job)
    e = equilibrium(Plant(job), job.position)
    normal = np.abs((e.error * job.off).sum(axis=1))
    assert best.step == pytest.approx(normal.min())
    assert best.given == pytest.approx(normal[0])
    assert best.step < 0.7 * best.given
    found = mill_job(machine, entered_at(path, best.way), process, at=(0.05, 0.05, 0), step=5e-3)
    assert abs(float(found.dataset.error_normal[0])) == pytest.approx(best.step, rel=0.02)


def test_stock_wider_than_the_tool_is_a_full_cut_whatever_the_deflection() -> None:
    """The force does not follow the wall there: the gain is nought and every point has an answer."""
    stock = box([(-0.2, -0.2, -0.005), (0.2, 0.2, 0.02)])
    found = mill_job(
        sm.load_machine("linear-delta"),
        outline("rectangle", (0.12, 0.08, 0.015)),
        "trimming",
        at=(0, 0, 0.3),
        stock=stock,
    )
    ds = found.dataset
    assert (ds.status.values == 0).all()
    assert np.isfinite(ds.error_normal_after.values).all()
    assert np.abs(ds.gain.values).max() == pytest.approx(0, abs=1e-9)
    assert ds.width.values == pytest.approx(found.job.process.tool.diameter)


def test_warnings_name_the_points_of_a_limit() -> None:
    found = mill_job(sm.load_machine("linear-delta"), outline("circle", (0.06,)), "trimming", at=(0, 0, 0.25))
    effort = next(w for w in found.warnings if w.name == "drive effort")
    assert effort.finding
    bit = 1 << found.dataset.warnings.attrs["names"].index("drive effort")
    assert ((found.dataset.warnings.values & bit > 0) == effort.points).all()
    assert effort.points.sum() > 0
    assert f"{int(effort.points.sum())} of {len(found.job)} points" in effort.text


def test_taper_is_the_tilt_over_the_depth() -> None:
    """An arm's wrist that gives way about one axis: the wall turns by moment over stiffness."""
    found = mill_job(sm.load_machine(ARM), outline("circle", (0.04,)), "trimming", at=(-0.75, -0.1, 0.3))
    job, e = found.job, found.before
    high = 1e-3
    top = np.cross(e.turned, high * job.tool)
    slope = (top * job.off).sum(axis=1) / high
    assert found.dataset.taper.values == pytest.approx(job.process.cut.axial * slope, abs=1e-12)
    assert np.abs(found.dataset.taper.values).max() > 1e-6
    assert (
        np.abs(mill_job(gantry(), outline("circle", (0.04,)), "trimming", at=(0, 0, 0)).dataset.taper).max()
        == 0
    )

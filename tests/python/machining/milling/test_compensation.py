"""Commands that put the loaded machine on the path, the program that holds them, and what it leaves."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry

import stiffmap as sm
from stiffmap.machining.milling import mill_job, sizes
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.program import program, run
from stiffmap.machining.process.description import EndMill
from stiffmap.machining.toolpath import Kind, outline, path_of
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.write import rewritten

AT = {"orthoglide-revised": (0.05, 0.05, 0.0), "linear-delta": (0, 0, 0.3), "ur10": (-0.8, -0.05, 0.3)}


@pytest.mark.parametrize("machine", AT)
def test_the_model_is_on_the_path(machine: str) -> None:
    size = (0.12, 0.1)
    found = mill_job(
        sm.load_machine(machine), outline("washbasin", size), "trimming", at=AT[machine], step=5e-3
    )
    ds = found.dataset
    assert float(ds.command_left.max()) < 1e-9
    there = equilibrium(Plant(found.job), ds.command.values)
    assert np.abs(there.error).max() < 1e-9
    # the program: chord error and digits remain
    b, a = sizes(ds.error_normal), sizes(ds.error_normal_after)
    assert a["largest"] < 0.04 * b["largest"]
    assert a["rms"] < 0.02 * b["rms"]
    fine = mill_job(found.job.machine, found.job.path, "trimming", at=AT[machine], step=1e-3, within=1e-8)
    again = run(fine.job, program(fine.job, fine.dataset.command.values, 1e-8), step=1e-3)
    assert sizes(again.normal)["largest"] < 0.01 * b["largest"]


def test_what_mirroring_leaves() -> None:
    """Where kp is constant, n mirror steps leave the n-th power of kp/(k + kp)."""
    process = sm.load_process("slot")
    pull, k = -3e4, 1e5
    process = replace(process, law=EndMill(0, 0, 0, 0, 0, pull))
    found = mill_job(gantry(z=1e3 / k), path_of([[-0.05, 0, 0], [0.05, 0, 0]]), process, at=(0, 0, 0))
    job = found.job
    plant = Plant(job)
    command, first = job.position.copy(), None
    share = -pull / (k - pull)
    for n in range(5):
        e = equilibrium(plant, command).error
        first = e if first is None else first
        assert e[:, 2] == pytest.approx(first[:, 2] * share**n, rel=1e-6)
        command = command - e


@pytest.mark.parametrize("corner", [(40, -40), (40, 40), (0, -10), (0, 10), (0, 0)])
@pytest.mark.parametrize("written", [True, False], ids=["program", "table"])
def test_both_walls_of_a_slot_go_round_its_corners(corner, written, tmp_path) -> None:
    """Right, left, acute and back: the error is that of a straight slot all along, and compensation leaves none, whichever the force
    at the joint, which is longer than the step."""
    x, y = corner
    (tmp_path / "a.ngc").write_text(
        f"G21 G90 G94\nM3 S6000\nG0 X0 Y0 Z0\nG1 X40 F900\nX{x} Y{y}\nG0 Z5\nM2\n"
    )
    path = tmp_path / "a.ngc" if written else path_of(np.array([[0, 0, 0], [40, 0, 0], [x, y, 0]]) * 1e-3)
    soft = 1e-2
    slot = sm.load_process("slot")
    slot = replace(slot, cut=replace(slot.cut, through=True))  # a force that nothing changes
    ds = mill_job(gantry(soft, soft, soft), path, slot, at=(0, 0, 0), step=0.5e-3).dataset
    straight = abs(sm.cutting_force(slot).mean[1]) * soft * 1e-3
    normal = ds.error_normal.values
    assert ds.wall.values.all() and np.abs(normal) == pytest.approx(np.full(len(normal), straight), rel=1e-3)
    assert np.abs(ds.error_normal_after.values).max() < 0.01 * straight


PROGRAM = """%
(head) G21 G90 G17 G94 G40
N10 S18000 M3 (start)
G0 X-60 Y40 Z5
G1 Z0 F6000
N20 G1 X40 (upper edge) ; to the right
G2 X60 Y20 I0 J-20
G1 X60 Y-20
G91 G2 X-20 Y-20 R20
G1 X-80
G90 G20 G2 X-2.3622047 Y-.7874016 I0 J.7874016 F236
G21 G1 X-60 Y40 F6000
(end)
G0 Z5
M5
M2
"""


def test_structure_words_and_comments_stay() -> None:
    path = load_gcode(PROGRAM.splitlines(), name="p")
    found = mill_job(sm.load_machine("orthoglide-revised"), path, "trimming", at=(0.05, 0.05, 0.0))
    text = found.program.text
    lines = text.splitlines()
    for kept in ("%", "(head) G21 G90 G17 G94 G40", "N10 S18000 M3 (start)", "(end)", "G0 Z5", "M5", "M2"):
        assert kept in lines
    first = next(line for line in lines if line.startswith("N20"))
    assert first.endswith("(upper edge) ; to the right")
    assert "G90 G20 G2 " in text
    assert sum(line.count("G2 X") for line in lines) >= 3  # arcs stay arcs
    assert found.program.pieces < 60
    assert sizes(found.dataset.error_normal_after)["rms"] < 0.001
    # commands differ from the wanted positions by about the error
    moved = found.program.path
    assert np.abs(moved.end[3] - path.end[2]).max() > 2e-5 or len(moved) > len(path)


def test_unchanged_programs_come_back() -> None:
    path = load_gcode(PROGRAM.splitlines(), name="p")
    text, origin = rewritten(path, {})
    again = load_gcode(text.splitlines(), name="p")
    assert origin == list(range(len(path)))
    assert again.end == pytest.approx(path.end, abs=2e-9)
    assert again.sweep == pytest.approx(path.sweep, abs=1e-6)
    assert again.feed[2:] == pytest.approx(path.feed[2:], nan_ok=True)


def test_inverse_time_keeps_its_time() -> None:
    text = "G21 G90 S18000 M3\nG93\nG1 X0 Y0 F100\nG1 X100 F60\nG1 Y50 F60\nG94\nM2\n"
    path = load_gcode(text.splitlines(), name="p")
    found = mill_job(sm.load_machine("orthoglide-revised"), path, "trimming", at=(0, 0, 0.0), within=1e-7)
    p = found.program.path
    time = p.length / p.feed
    for i in (1, 2):
        mine = (found.program.origin == i) & (p.length > 1e-6)
        assert mine.sum() > 1
        # the corner between them takes a short joint, some 0.2 mm
        assert time[found.program.origin == i].sum() == pytest.approx(1.0, rel=5e-3)


def test_points_come_back_as_points() -> None:
    t = np.linspace(0, -2 * np.pi, 181)
    path = path_of(np.stack([0.06 * np.cos(t), 0.06 * np.sin(t), 0 * t], axis=1))
    found = mill_job(sm.load_machine("linear-delta"), path, "trimming", at=(0, 0, 0.3), step=1.0)
    assert found.program.suffix == ".csv"
    assert len(found.program.text.splitlines()) == 182
    assert re.match(r"x_mm,y_mm,z_mm,feed_mm_min", found.program.text)
    assert (
        sizes(found.dataset.error_normal_after)["largest"]
        < 0.02 * sizes(found.dataset.error_normal)["largest"]
    )


def test_the_arc_of_a_moved_circle_is_a_circle() -> None:
    from stiffmap.machining.toolpath.pieces import arc_pieces, line_pieces

    t = np.linspace(0, 1.2, 41)
    points = np.stack([0.1 * np.cos(t) + 3, 0.1 * np.sin(t), 0.01 * t], axis=1)
    found = arc_pieces(points, 2, 1.0, 1e-9)
    assert len(found) == 1
    assert found[0].kind == Kind.ARC
    assert found[0].sweep == pytest.approx(1.2)
    assert found[0].centre[:2] == pytest.approx([3, 0])
    assert len(line_pieces(points[:3], 1.0)) == 1
    assert len(line_pieces(points, 1e-6)) > 10


@pytest.mark.parametrize("seed", range(4))
def test_a_bent_line_becomes_its_own_corners(seed: int) -> None:
    """Many points of a few straight lines, and a turn of the tool with kinks elsewhere: the pieces end there and nowhere else."""
    from stiffmap.machining.toolpath.pieces import line_pieces

    rng = np.random.default_rng(seed)
    corners = np.cumsum(rng.uniform(0.01, 0.05, (6, 3)) * rng.choice([-1, 1], (6, 3)), axis=0)
    at = np.arange(6) * 17  # a corner at every 17th point
    points = np.stack([np.interp(np.arange(86), at, corners[:, k]) for k in range(3)], axis=1)
    found = line_pieces(points, 1e-7)
    assert np.array([p.end for p in found]) == pytest.approx(corners[1:], abs=1e-12)
    kinks = np.array([0, 9, 40, 71, 85])
    turn = np.interp(np.arange(86), kinks, rng.uniform(-1, 1, 5))
    straight = np.linspace(corners[0], corners[1], 86)
    found = line_pieces(straight, 1e-7, turn)
    assert np.array([p.end for p in found]) == pytest.approx(straight[kinks[1:]], abs=1e-12)
    assert [p.turn for p in found] == pytest.approx(turn[kinks[1:]], abs=1e-12)


def test_the_band_of_the_force() -> None:
    """20 % more force leaves about a fifth of the error, less what the loop gives back."""
    found = mill_job(
        sm.load_machine("orthoglide-revised"), "circle", "trimming", at=(0.05, 0.05, 0), band=True
    )
    ds = found.dataset
    for name, share in (("low", -0.2), ("high", 0.2)):
        ratio = ds[f"error_normal_after_{name}"].values / ds.error_normal.values
        assert np.median(ratio) == pytest.approx(share, abs=0.02)

"""Tables, CL files, outlines, points along them and the engagement there."""

from __future__ import annotations

from math import acos, pi
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.machining.toolpath import (
    Engagement,
    box,
    engagement,
    load_path,
    outline,
    outline_names,
    path_of,
    sampled,
)


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_table(tmp_path: Path) -> None:
    p = load_path(
        write(
            tmp_path,
            "p.csv",
            "x_mm,y [mm],z [m],feed_mm_min,spindle_rpm,i,j,k\n0,0,0,600,60,0,0,2\n10,0,0.001,1200,60,0,1,1\n0,5,0,600,60,0,0,1\n",
        )
    )
    assert p.end[0].tolist() == [0.01, 0, 0.001]
    assert p.feed.tolist() == pytest.approx([0.02, 0.01])
    assert p.spindle[0] == pytest.approx(2 * pi)
    assert p.tool[0] == pytest.approx([0, 2**-0.5, 2**-0.5])
    assert p.line.tolist() == [3, 4]


def test_a_cl_file(tmp_path: Path) -> None:
    text = "PARTNO/TEST\nUNITS/MM\nSPINDL/6000,CLW\nRAPID\nGOTO/0,0,0\nFEDRAT/600,MMPM\nGOTO/10,0,$\n0\nGOTO/10,5,0,0,0,1 $$ note\nFINI\n"
    p = load_path(write(tmp_path, "p.cl", text))
    assert (1e3 * p.end).tolist() == [[10, 0, 0], [10, 5, 0]]
    assert p.feed.tolist() == pytest.approx([0.01, 0.01])
    assert p.spindle[0] == pytest.approx(200 * pi)


@pytest.mark.parametrize(
    "text",
    [
        "STOP", "OPSTOP", "PARTNO BRACKET 10/20", "PPRINT pocket, first side", "REMARK", "TPRINT/T1 end mill",
        "$$-> CSYS / 1.0, 0.0, 0.0, $\n  0.0, 1.0, 0.0, $\n  0.0, 0.0, 1.0", "$$ costs 5 $",
    ],
)  # fmt: skip
def test_stops_and_texts_of_a_cl_file_leave_its_path_whole(text: str, tmp_path: Path) -> None:
    head = "UNITS/MM\nSPINDL/6000,CLW\nRAPID\nGOTO/0,0,0\nFEDRAT/600,MMPM\nGOTO/10,0,0\n"
    p = load_path(write(tmp_path, "p.cl", f"{head}{text}\nGOTO/20,0,0\nFINI\n"))
    assert (1e3 * p.end).tolist() == [[10, 0, 0], [20, 0, 0]]


def test_letters_of_a_controller_name_columns(tmp_path: Path) -> None:
    text = "X (mm),Y (mm),Z (mm),F (mm/min),S (rpm)\n0,0,0,600,60\n10,0,0,1200,60\n"
    p = load_path(write(tmp_path, "p.csv", text))
    assert (p.feed[0], p.spindle[0]) == pytest.approx((0.02, 2 * pi))


@pytest.mark.parametrize("name", outline_names())
def test_outlines_close_without_corners(name: str) -> None:
    p = outline(name)
    c = p.only(p.cuts)
    assert np.abs(c.start[1:] - c.end[:-1]).max() < 1e-12
    assert np.abs(c.start[0] - c.end[-1]).max() < 1e-12
    a = c.at(np.arange(len(c)), np.ones(len(c)))[1]
    b = c.at(np.arange(len(c)), np.zeros(len(c)))[1]
    assert (a * np.roll(b, -1, axis=0)).sum(axis=1) == pytest.approx(np.ones(len(c)), abs=1e-9)
    q = sampled(p, 1e-3)
    area = 0.5 * np.cross(q.position[:-1, :2], q.position[1:, :2]).sum()
    assert (area > 0) == (name == "pocket")  # around a part clockwise, in a pocket counter-clockwise
    assert q.way[-1] == pytest.approx(c.length.sum())


def test_a_curve_of_points_is_a_curve() -> None:
    """A circle as a table has the circle's curvature and engagement, each point once."""
    t = np.linspace(0, -2 * pi, 401)
    p = path_of(np.stack([0.1 * np.cos(t), 0.1 * np.sin(t), 0 * t], axis=1))
    q = sampled(p, 1.0)
    assert len(q) == 401
    process = sm.load_process("trimming")
    e = engagement(q, p, process)
    assert e.curvature == pytest.approx(np.full(401, -10.0), rel=1e-3)
    pocket = outline("pocket")
    q = sampled(pocket, 1e-4)
    k = engagement(q, pocket, process).curvature
    assert k.max() == pytest.approx(100.0)
    assert k.min() == pytest.approx(0.0, abs=1e-9)
    # from a line to an arc over the way that the contact reaches ahead
    reach = process.tool.diameter / 2 * np.sin(process.arc)
    corner = q.way[np.flatnonzero(pocket.kind[q.move] == 2)[0]]
    half = np.interp(corner - reach / 2, q.way, k)  # the stock is aside by the square of what is left
    assert half == pytest.approx(25.0, rel=0.02)


def test_an_inside_corner_of_a_pocket() -> None:
    """At a right-angled corner the engaged arc rises by a quarter turn (theory.md, M8)."""
    p = path_of(
        [[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0]]
    )  # turns left, the part lies right: an inside corner
    process = sm.load_process("trimming")
    q = sampled(p, 1e-3)
    extra = engagement(q, p, process).corner
    at = int(np.flatnonzero(q.move == 0)[-1])
    assert extra[at] == pytest.approx(pi / 2)
    assert extra[0] == 0.0
    assert extra[at + 1 :].max() == 0.0
    r, ae, d = process.tool.diameter / 2, process.cut.radial, 2e-3
    before = int(np.argmin(np.abs(q.way - (0.05 - d))))
    assert extra[before] == pytest.approx(pi / 2 + acos(1 - (ae - d) / r) - acos(1 - ae / r))
    away = path_of([[0, 0, 0], [0.05, 0, 0], [0.05, -0.05, 0]])
    assert engagement(sampled(away), away, process).corner.max() == 0.0


def test_stock_says_width_and_depth() -> None:
    process = sm.load_process("trimming")
    p = path_of([[-0.2, 0, 0], [0.2, 0, 0]])  # part right of it, stock to the left
    q = sampled(p, 0.01)
    e = engagement(q, p, process, box([[-0.1, -1, -0.1], [0.1, -3e-3, 5e-3]]))
    inside = np.abs(q.position[:, 0]) < 0.0999
    assert e.radial[inside] == pytest.approx(np.full(inside.sum(), 3e-3))
    assert e.axial[inside] == pytest.approx(np.full(inside.sum(), 5e-3))
    assert e.radial[np.abs(q.position[:, 0]) > 0.1001].max() == 0.0
    e = engagement(q, p, process, box([[-1e3, -1e3, 0.0], [1e3, 1e3, 3e-3]]))
    assert e.axial == pytest.approx(np.full(len(q), 3e-3))
    assert (e.radial > process.tool.diameter).all()  # the tool cuts its diameter of it
    assert engagement(q, p, process, thickness=2e-3).radial[0] == 2e-3


NX = """TOOL PATH/CAVITY,TOOL,MILL10
TLDATA/MILL,10.0000,0.0000,75.0000,0.0000,0.0000
MSYS/0.0,0.0,0.0,1.0,0.0,0.0,0.0,1.0,0.0
PAINT/SPEED,10
LOAD/TOOL,1
UNITS/MM
SPINDL/RPM,3000,CLW
RAPID
GOTO/0.0,0.0,10.0,0.0,0.6,0.8
PAINT/COLOR,31
FEDRAT/MMPM,250.0
GOTO/0.0,0.0,-1.0
END-OF-PATH
TOOL PATH/FINISH,TOOL,MILL10
MSYS/0.0,0.0,0.0,1.0,0.0,0.0,0.0,1.0,0.0
GOTO/10.0,0.0,-1.0,0.0,0.0,1.0
MULTAX/OFF
GOTO/20.0,0.0,-1.0
END-OF-PATH
"""


def test_a_cl_file_of_nx_says_the_axis_of_the_tool_where_it_changes(tmp_path: Path) -> None:
    p = load_path(write(tmp_path, "p.cls", NX))
    assert p.tool == pytest.approx(np.array([[0, 0.6, 0.8], [0, 0, 1], [0, 0, 1]]))
    assert (1e3 * p.end).tolist() == [[0, 0, -1], [10, 0, -1], [20, 0, -1]]


@pytest.mark.parametrize("name", ["trimming", "slot"])
def test_stock_that_the_tool_does_not_reach_is_not_cut(name: str) -> None:
    """The part lies right of the path, the stock left of it: next to the wall, behind a gap, beyond the tool, or only ahead."""
    process = sm.load_process(name)
    d = process.tool.diameter
    p = path_of([[-0.2, 0, 0], [0.2, 0, 0]])
    q = sampled(p, 0.01)
    near, far = (-d / 2, d / 2) if name == "trimming" else (d / 2, -d / 2)  # of the tool, y

    def cut(y0: float, y1: float, x: float = 1.0) -> Engagement:
        low, high = sorted((y0, y1))
        return engagement(q, p, process, np.array([[-1.0, low, -0.1], [x, high, 5e-3]]))

    assert (cut(2 * near, 0.9 * far).axial > 0).all()
    gap = cut(0.5 * near, 9 * far)
    assert gap.radial == pytest.approx(np.full(len(q), 0.75 * d))
    ahead = cut(2 * near, 2 * far, x=0.0)
    assert (ahead.axial[q.position[:, 0] > 1e-9] == 0).all()
    for y0, y1 in ((1.1 * far, 9 * far), (9 * near, 1.1 * near)):
        with pytest.raises(
            StiffmapError, match=r"stock: the tool cuts nothing of it, .* mm; the tip goes from \(-200.0"
        ):
            cut(y0, y1)


BAD = [
    ("p.csv", "x,y_mm,z_mm\n0,0,0\n1,0,0\n", "unit is missing"),
    ("p.csv", "x_mm,y_mm\n0,0\n1,0\n", "missing column z_mm"),
    ("p.csv", "x_mm,y_mm,z_mm,q\n0,0,0,0\n1,0,0,0\n", "unknown column"),
    ("p.csv", "x_mm,y_mm,z_mm\n0,0,0\n1,0\n", "expected 3 values"),
    ("p.csv", "x_mm,y_mm,z_mm\n0,0,0\n1,zero,0\n", "expected a number"),
    ("p.csv", "x_mm,y_mm,z_mm\n0,0,0\n", "two or more points"),
    ("p.csv", "x_mm,y_mm,z_mm,feed_mm_min\n0,0,0,600\n1,0,0,0\n", "feed above zero"),
    ("p.csv", "x_mm,y_mm,z_mm,spindle_rpm\n0,0,0,600\n1,0,0,0\n", "spindle is off"),
    ("p.csv", "x_mm,y_mm,z_mm,i\n0,0,0,1\n1,0,0,1\n", "needs the columns"),
    ("p.csv", "x_mm,y_mm,z_mm,i,j,k\n0,0,0,0,0,1\n1,0,0,0,0,0\n", "not zero"),
    ("p.cl", "GOTO/0,0,0\nGOTO/1,0,0\n", "UNITS/MM"),
    ("p.cl", "UNITS/MM\nGOTO/0,0\n", "3 or 6 numbers"),
    (
        "p.cl",
        "UNITS/MM\nCUTCOM/OFF\nDELAY/2\nGOTO/1,,0,5\n",
        "line 4: GOTO: expected a number, found ''",
    ),
    ("p.cl", "UNITS/MM\nCYCLE/DRILL\n", "unknown word 'CYCLE'"),
    ("p.cl", "UNITS/MM\nFEDRAT/0,MMPM\n", "above zero"),
    ("p.cl", "UNITS/MM\nCIRCLE/0,0,0,0,0,1,5\n", "CIRCLE: expected lines (GOTO)"),
    (
        "p.cl",
        "UNITS/MM\nMULTAX/ON\nGOTO/0,0,0,0,1,1\nMULTAX/OFF\nGOTO/1,0,0\n",
        "line 5: GOTO: expected 6 numbers",
    ),
    (
        "p.cls",
        "MSYS/0,0,0,1,0,0,0,1,0\nTLDATA/MILL,10\nMSYS/0,0,5,1,0,0,0,1,0\n",
        "line 3: MSYS: a second origin",
    ),
    ("p.txt", "hello", "unknown kind of path"),
]


@pytest.mark.parametrize(("name", "text", "message"), BAD, ids=[m for _, _, m in BAD])
def test_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    with pytest.raises(FileError) as caught:
        load_path(write(tmp_path, name, text))
    assert message in str(caught.value)


def test_refused_without_a_file() -> None:
    with pytest.raises(FileError, match="did you mean 'washbasin'"):
        load_path("washbasn")
    with pytest.raises(StiffmapError, match="expected the size width,depth"):
        load_path("washbasin", size=(1.0,))
    with pytest.raises(StiffmapError, match="no move cuts"):
        sampled(path_of([[0, 0, 0], [0, 0, 1]]))
    p = outline("circle")
    with pytest.raises(StiffmapError, match="tool's diameter"):
        engagement(sampled(p), p, sm.load_process("trimming"), thickness=1.0)
    with pytest.raises(StiffmapError, match="lower first"):
        box([[0, 0, 0], [1, 1, -1]])


@pytest.mark.parametrize("downwards", [True, False])
def test_across_a_curve_that_dives_is_its_own_side(downwards: bool, tmp_path: Path) -> None:
    """An arc in a vertical plane between two lines across it: where it goes along the tool its side is not that of a line."""
    arc = "G2 X10 Z-10 I10" if downwards else "G2 X10 Z10 K10"
    text = f"G21 G90 G17 F1000 S10000 M3\nG0 X0 Y-20 Z0\nG1 Y0\nG18 {arc}\nG1 Y20\n"
    path = load_path(write(tmp_path, "dive.ngc", text))
    points = sampled(path)
    on_arc = np.isin(points.move, np.flatnonzero(path.sweep))
    assert abs(path.sweep[path.sweep != 0]) == pytest.approx(pi / 2)
    assert points.along[on_arc].any()
    np.testing.assert_allclose(
        np.abs(points.normal[on_arc]), np.tile([0.0, 1.0, 0.0], (on_arc.sum(), 1)), atol=1e-9
    )


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p.h", "BEGIN PGM ONE MM\n"),
        ("p.nc", "%\n12 L X+5 Y-2 R0 FMAX M3\n"),
        ("p.mpf", "N10 G90 G54\nN20 G21 G1 X=IC(5) F500\n"),
        ("p.src", "DEF part( )\nPTP {A1 0, A2 -90}\n"),
        ("p.nc", "MODULE Part\n  MoveL p1, v100, fine, tool0;\n"),
    ],
)
def test_programs_in_a_language_of_a_controller_are_to_be_exported(
    name: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match=r"of Heidenhain, KRL, RAPID.*, export G-code \(ISO\), APT or points"):
        load_path(tmp_path / name)

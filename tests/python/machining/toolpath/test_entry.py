"""Closed outlines entered elsewhere or run the other way, and the G-code that they become."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.common.errors import StiffmapError
from stiffmap.machining.toolpath import Kind, Toolpath, outline, path_of, sampled
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.outlines import entered_at, fresh_text, turned_round

NAMES = ["washbasin", "bathtub", "rectangle", "circle", "pocket"]


def shape(path: Toolpath, way: float) -> np.ndarray:
    """Positions at even distances along the cuts, from `way` on and round."""
    p = sampled(path, 1e-4)
    length = p.way[-1]
    at = (way + np.linspace(0, length, 200)) % length
    return np.stack([np.interp(at, p.way, p.position[:, k]) for k in range(3)], axis=1)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [0.0, 0.13, 0.5, 0.999])
def test_the_same_outline_from_another_place(name: str, share: float) -> None:
    path = outline(name)
    length = float(path.length[path.cuts].sum())
    made = entered_at(path, share * length)
    assert float(made.length[made.cuts].sum()) == pytest.approx(length, rel=1e-7)
    assert shape(made, 0.0) == pytest.approx(shape(path, share * length), abs=3e-6)
    cuts = np.flatnonzero(made.cuts)
    entry = made.start[cuts[0]]
    assert made.end[cuts[-1]] == pytest.approx(entry, abs=2e-9)
    # the approach stands over the entry, the retreat leaves from there
    assert made.end[cuts[0] - 2][:2] == pytest.approx(entry[:2], abs=2e-9)
    assert made.kind[cuts[0] - 2] == Kind.RAPID
    assert made.start[cuts[-1] + 1] == pytest.approx(entry, abs=2e-9)
    assert made.end[cuts[-1] + 1][2] == pytest.approx(5e-3)
    assert made.feed[cuts] == pytest.approx(path.feed[path.cuts][0])
    assert np.isfinite(made.spindle[cuts]).all()


def test_what_has_no_other_entry() -> None:
    with pytest.raises(StiffmapError, match="one closed outline; here they are open"):
        entered_at(path_of([[0, 0, 0], [0.1, 0, 0]]), 0.05)
    with pytest.raises(StiffmapError, match=r"entry: expected 0 to 628\.319 mm"):
        entered_at(outline("circle"), 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_the_other_way_round(name: str) -> None:
    path = outline(name)
    back = turned_round(path)
    a, b = sampled(path, 1e-3), sampled(back, 1e-3)
    assert b.position == pytest.approx(a.position[::-1], abs=2e-9)
    assert b.tangent == pytest.approx(-a.tangent[::-1], abs=1e-6)
    again = turned_round(back)
    assert again.end == pytest.approx(path.end, abs=2e-9)


def test_an_open_cut_is_approached_at_its_other_end() -> None:
    text = "G21 G90 S6000 M3\nG0 X0 Y0 Z5\nG1 Z0 F600\nG1 X50\nG0 Z5\nM2"
    back = turned_round(load_gcode(text.splitlines()))
    assert (1e3 * back.end).round(6).tolist() == [[50, 0, 5], [50, 0, 0], [0, 0, 0], [0, 0, 5]]


def test_fresh_lines_say_the_same() -> None:
    text = (
        "G21 G90 G91.1 S6000 M3\nG0 X10 Y0 Z0\nG2 X10 Y0 Z-4 I-10 J0 P3 F300\nG18 G3 X20 Z-4 I5 K0 F400\nG1 Y5 C30\nM4\nG1 X1\nM5\n"
        "G93 G1 X2 F10\nG20 G94 G1 X1 F10\nM2"
    )
    path = load_gcode(text.splitlines())
    again = load_gcode(fresh_text(path).splitlines())
    for name in ("kind", "start", "end", "normal", "sweep", "feed", "spindle"):
        assert getattr(again, name) == pytest.approx(getattr(path, name), abs=1e-8, nan_ok=True), name
    assert again.turn is not None
    assert np.degrees(again.turn)[-1] == pytest.approx(30)


@pytest.mark.parametrize(
    ("before", "kept"),
    [("M8", ["M8"]), ("M7\nM8", ["M7", "M8"]), ("M8\nM9\nM7", ["M7"]), ("M8\nM9", []), ("", [])],
)
def test_lines_of_its_own_keep_the_coolant(before: str, kept: list[str]) -> None:
    text = f"G21 G90 S6000 M3\nG0 X0 Y0 Z5\n{before}\nG1 Z0 F600\nG1 X50\nM9\nG0 Z5\nM2"
    made = turned_round(load_gcode(text.splitlines())).text
    assert [w for w in made if w in ("M7", "M8")] == kept
    assert ("M9" in made) == bool(kept)

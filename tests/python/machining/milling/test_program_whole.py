"""What is written is cut by a controller that starts anywhere: the wanted way, whole, in order, with what goes with it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry
from tests.python.machining.toolpath.controller import UNKNOWN, Controller

from stiffmap.machining.milling import mill_job
from stiffmap.machining.toolpath import outline
from stiffmap.machining.toolpath.entry import entered_at, turned_round
from stiffmap.machining.toolpath.gcode.fresh import fresh_text
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.path import Toolpath

HEAD = "G21 G90 G17 S18000 M3\n"
FAR = 0.5
"""mm by which the commands here may be off the wanted way, and more than they are."""


def written(text: str, offsets: dict[str, tuple[float, ...]] | None = None) -> str:
    path = load_gcode(text.splitlines(), name="p", offsets=offsets)
    return mill_job(gantry(x=4e-4, y=1e-3), path, "trimming", at=(0, 0, 0)).program.text


def apart(one: Controller, other: Controller) -> float:
    """mm: how far a point of either way is from the other way, at most."""
    a, b = (
        np.vstack([np.linspace(c[k], c[k + 1], 40) for c, _ in m.cuts for k in range(len(c) - 1)])
        for m in (one, other)
    )
    far = np.linalg.norm(a[:, None] - b[None], axis=2) if len(a) * len(b) < 2e7 else np.zeros((1, 1))
    return float(max(far.min(axis=1).max(), far.min(axis=0).max()))


UNSURE = {
    "starts at zero": "G0 X0 Y40 Z5\nG1 Z0 F6000\nG1 X40\nG0 Z5\nM2",
    "height first": "G0 Z0\nG0 X0 Y0\nG1 X30 F6000\nM2",
    "another offset, not given": "G54 G0 X0 Y0 Z0\nG1 X30 F6000\nG55 G0 X30 Y0 Z0\nG1 Y30\nM2",
    "tool changed": "G0 X0 Y0 Z0\nG1 X30 F6000\nT2 M6\nG0 X30 Y0 Z0\nG1 Y30\nM2",
    "another length": "G0 X0 Y0 Z0\nG1 X30 F6000\nG43 H2\nG0 X30 Y0 Z0\nG1 Y30\nM2",
    "optional line": "G0 X0 Y0 Z0\n/G1 X30 F6000\nG0 X30 Y0 Z0\nG1 Y30 F6000\nM2",
}


@pytest.mark.parametrize("name", UNSURE)
def test_a_word_is_left_out_only_where_its_value_is_held(name: str) -> None:
    """Where the controller may stand elsewhere, the lines after it name every axis before a cut."""
    text = written(HEAD + UNSURE[name])
    held: set[str] = set()
    for line in text.splitlines():
        words = {w[0] for w in line.lstrip("/").split()}
        if {"M6", "G55", "G43"} & set(line.split()):
            held = set()
        if words & set("XYZ") and line.startswith("G1"):
            assert held == set("XYZ") or words >= set("XYZ"), (line, text)
        held |= words & set("XYZ")
        if line.startswith("/"):
            held = set()


@pytest.mark.parametrize("name", ["washbasin", "bathtub", "rectangle", "circle", "pocket"])
@pytest.mark.parametrize("how", ["as it is", "reversed", "entered elsewhere"])
def test_outlines_from_an_unknown_start(name: str, how: str) -> None:
    path = outline(name)
    if how == "reversed":
        path = turned_round(path)
    elif how == "entered elsewhere":
        path = entered_at(path, 0.13)
    for text in (fresh_text(path), mill_job(gantry(), path, "trimming", at=(0, 0, 0)).program.text):
        found = Controller(text)
        assert np.abs(np.subtract(found.way[1:], UNKNOWN)).min(axis=0)[0] > 1  # nothing of where it was left
        assert found.way[-1][:2] == pytest.approx(found.way[1][:2], abs=FAR)
        cuts = 1e3 * path.length[path.cuts].sum()
        assert found.length == pytest.approx(cuts + 5, abs=5.0)  # and the plunge


@pytest.mark.parametrize(
    ("said", "missing"),
    [("G21", "G90 G94 G17 G91.1"), ("G21 G90 G94", "G17 G91.1"), ("G21 G17 G94 G91.1 G90", "")],
)
def test_modes_that_are_taken_are_written(said: str, missing: str) -> None:
    text = written(said + " S18000 M3\nG0 X0 Y20 Z0\nG1 X30 F6000\nG2 X50 Y0 I0 J-20\nM2")
    assert (missing in text.splitlines()) or not missing
    assert Controller(text).way[-1] == pytest.approx((50, 0, 0), abs=FAR)


def test_nothing_is_sent_anywhere_before_the_program_does() -> None:
    """A retreat that names its height alone stays one, written anew as well."""
    text = HEAD + "G0 Z5\nG0 X0 Y0\nG1 Z0 F6000\nG1 X30\nG0 Z5\nM2"
    path = turned_round(load_gcode(text.splitlines(), name="p"))
    for made in (written(text), fresh_text(path)):
        assert "G0 Z5" in made.splitlines()
        assert "X" not in made.split("G0 Z5")[0]


def test_lines_of_its_own_keep_the_offset() -> None:
    offsets = {"G55": (0.1, 0.02, 0.0)}
    path = load_gcode((HEAD + "G55 G0 X0 Y0 Z0\nG1 X30 F600\nM2").splitlines(), offsets=offsets)
    back: Toolpath = turned_round(path)
    assert back.end == pytest.approx(np.array([[0.13, 0.02, 0], [0.1, 0.02, 0]]))
    assert Controller(fresh_text(back), offsets).way[-1] == pytest.approx((100, 20, 0))

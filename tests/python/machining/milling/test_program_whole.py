"""What is written is cut by a controller that starts anywhere: the wanted way, whole, in order, with what goes with it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.machining.milling.gantry import gantry
from tests.python.machining.milling.random_programs import Program
from tests.python.machining.toolpath.controller import UNKNOWN, Controller

from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling import mill_job
from stiffmap.machining.milling.program import program, run
from stiffmap.machining.milling.setting import setting
from stiffmap.machining.process import load_process
from stiffmap.machining.toolpath import load_path, outline, sampled
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.outlines import entered_at, fresh_text, turned_round
from stiffmap.machining.toolpath.path import Toolpath

HEAD = "G21 G90 G17 S18000 M3\n"
FAR = 0.5
"""mm by which the commands here may be off the wanted way, and more than they are."""


def written(text: str, offsets: dict[str, tuple[float, ...]] | None = None) -> str:
    path = load_gcode(text.splitlines(), name="p", offsets=offsets)
    return mill_job(gantry(x=1e-4, y=2.5e-4), path, "trimming", at=(0, 0, 0)).program.text


def apart(one: Controller, other: Controller) -> float:
    """mm: how far a point of either way is from the other way, at most."""
    a, b = (
        np.vstack([_dense(c[k], c[k + 1]) for c, _ in m.cuts for k in range(len(c) - 1)])
        for m in (one, other)
    )
    far = np.linalg.norm(a[:, None] - b[None], axis=2)
    return float(max(far.min(axis=1).max(), far.min(axis=0).max()))


def _dense(a: tuple[float, ...], b: tuple[float, ...]) -> np.ndarray:
    return np.linspace(a, b, 2 + int(np.linalg.norm(np.subtract(b, a)) / 0.2))


UNSURE = {
    "starts at zero": "G0 X0 Y40 Z5\nG1 Z0 F6000\nG1 X40\nG0 Z5\nM2",
    "height first": "G0 Z0\nG0 X0 Y0\nG1 X30 F6000\nM2",
    "another offset, not given": "G54 G0 X0 Y0 Z0\nG1 X30 F6000\nG55 G0 X30 Y0 Z0\nG1 Y30\nM2",
    "tool changed": "G0 X0 Y0 Z0\nG1 X30 F6000\nT2 M6\nM3 G0 X30 Y0 Z0\nG1 Y30\nM2",
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


G55 = {"G54": (0.0, 0.0, 0.0), "G55": (0.05, 0.02, 0.001)}
WHOLE = {
    "end in the last cut": ("G0 X0 Y0 Z0\nG1 X30 F6000\nG1 Y145 M2", None),
    "end in a cut, M30 first": ("G0 X0 Y0 Z0\nG1 X30 F6000\nM30 G1 Y145 (end)", None),
    "stop in a cut": ("G0 X0 Y0 Z0\nG1 X30 F6000\nG1 Y80 M0\nG1 X0\nM2", None),
    "optional stop in an arc": ("G0 X0 Y40 Z0\nG1 X30 F6000\nG2 X50 Y20 I0 J-20 M1\nG1 Y0\nM2", None),
    "axes of the machine": ("G55 G0 X0 Y0 Z0\nG53 G1 X80 Y20 F6000\nG53 G1 X80 Y70\nG1 X0\nM2", G55),
    "axes of the machine, modal": ("G55 G0 X0 Y0 Z0\nG1 X10 F6000\nG53 X80\nG53 Y90\nM2", G55),
    "optional cut": ("G0 X0 Y0 Z0\nG1 X30 F6000\n/G1 Y80\n/G1 X0\nG0 X0 Y0\nG1 Y-20\nM2", None),
    "spindle and coolant": ("G0 X0 Y0 Z0\nG1 X30 F6000\nG1 Y80 M8\nG1 X0 S17000 M3\nG4 P0.5\nG1 Y0 M9\nM5\nM2", None),
    "inches, relative": ("G0 X0 Y0 Z0\nG20 G91\nF236\nG1 X1.2\nG1 Y3 M0\nG90 G21\nG1 X0 Y0 M30", None),
    "blanks within words": ("G 0 X0 Y 0 Z0\nG 0 1 X3 0 F 6 000\nG 9 1 Y4 0 M 0\nG90 X0 M 3 0", None),
    "after the end": ("G0 X0 Y0 Z0\nG1 X30 F6000\nG1 Y50 M2\nG1 X900 Y900", None),
    "inverse time": ("G0 X0 Y0 Z0\nG93 G1 X30 F200\nG1 Y80 F120 M1\nG94\nM2", None),
    "turns": ("G0 X0 Y0 Z0\nG2 X0 Y0 Z-2 I20 J0 P2 F6000\nG1 Y-30 M30", None),
    "no unit but one": ("G0 X0 Y0\nG1 X30 F6000\nG1 Y50\nM2", None),
}  # fmt: skip


@pytest.mark.parametrize("name", WHOLE)
def test_the_written_program_is_cut_whole(name: str) -> None:
    text, offsets = WHOLE[name]
    want = Controller("G90 G94 G17 G91.1\n" + HEAD + "G0 X0 Y0 Z0\n" + text, offsets)
    made = written(HEAD + text, offsets)
    found = Controller(made, offsets)
    assert apart(found, want) < FAR
    assert found.length == pytest.approx(want.length, abs=4 * FAR)
    assert [w for w, _ in found.events] == [w for w, _ in want.events]
    for (word, k), (_, j) in zip(found.events, want.events, strict=True):
        at, to = (m.cuts[n - 1][0][-1] if n else None for m, n in ((found, k), (want, j)))
        assert (at is None) == (to is None), word
        if at is not None and to is not None:
            assert at == pytest.approx(to, abs=FAR), word
    assert max(f for _, f in found.cuts) == pytest.approx(max(f for _, f in want.cuts), rel=1e-3)


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(n, marks=pytest.mark.slow) for n in range(20, 35))]
)
def test_programs_at_random_are_cut_whole(seed: int) -> None:
    offsets = {"G54": (0.0, 0.0, 0.0), "G55": (0.01, -0.005, 0.001)}
    text = Program(seed).text
    want = Controller("G90 G94 G17 G91.1\nG0 X0 Y0 Z0\n" + text.split("%\n")[1], offsets)
    found = Controller(written(text, offsets), offsets)
    assert apart(found, want) < FAR
    assert found.length == pytest.approx(want.length, abs=FAR * len(want.cuts))
    assert [w for w, _ in found.events] == [w for w, _ in want.events]


@pytest.mark.parametrize(
    ("text", "feeds"),
    [
        ("G21 F6000 S18000 M3 G90\nG0 X0 Y0 Z0\nG1 X40\nM2", [6000]),
        ("G21 S18000 M3\nG0 X0 Y0 Z0\nG1 X40 F6000\nG20 G1 Y2 F200\nG21 F3000\nX0\nM2", [6000, 5080, 3000]),
        ("G21 S18000 M3\nG0 X0 Y0 Z0\nG1 X40 F6000\n/G20 G1 Y2 F200\n/N5 F3000 G21\nX0 F3000\nM2", [6000, 5080, 3000]),
        ("G21 S18000 M3\nG0 X0 Y0 Z0\nG94 G1 X40 F6000\nG94 G1 Y40 F6000\nM2", [6000]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("chosen", [False, True])
def test_a_feed_beside_its_unit_or_mode(text: str, feeds: list[float], chosen: bool) -> None:
    """A controller takes F in the unit that stood before the line, and none outlives G94, as rs274 of LinuxCNC has it."""
    path = load_gcode(text.splitlines(), name="p")
    assert list(dict.fromkeys(np.round(6e4 * path.feed[path.cuts], 6))) == feeds
    job = setting(gantry(), path, load_process("trimming"), sampled(path, 2e-3), path.placed((0, 0, 0)))
    made = program(job, job.position, feeds=path.feed if chosen else None)
    found = Controller(made.text)
    assert [f for f, _ in itertools.groupby(round(f, 2) for _, f in found.cuts)] == pytest.approx(feeds)


def test_optional_lines_are_left_out_whole() -> None:
    text = HEAD + WHOLE["optional cut"][0]
    want = Controller("G90 G94\n" + text, skip=True)
    found = Controller(written(text), skip=True)
    assert apart(found, want) < FAR
    assert found.length == pytest.approx(want.length, abs=2 * FAR)


SPOILT: dict[str, Callable[[list[str]], list[str]]] = {
    "a piece less": lambda t: [*t[:5], *t[6:]],
    "cut short": lambda t: [*t[:6], "M2", *t[6:]],
    "two exchanged": lambda t: [*t[:5], t[6], t[5], *t[7:]],
    "a stop too early": lambda t: [*t[:5], "M0", *[line.replace(" M0", "") for line in t[5:]]],
    "another feed": lambda t: [line.replace("F6000", "F600") for line in t],
    "rapid": lambda t: [*t[:5], t[5].replace("G1", "G0"), *t[6:]],
    "once more": lambda t: [*t[:6], t[4], t[5], *t[6:]],
    "starts anywhere": lambda t: [line.replace("G0 X", "G0 (X) ").replace("Y-0.18", "(Y)") if line.startswith("G0") else line for line in t],
    "a detour": lambda t: [*t[:5], t[5] + "\nG1 Y50", *t[6:]],
    "modes not said": lambda t: [line for line in t if line != "G94"],
    "aside": lambda t: [*t[:5], t[5].replace("Y", "Y0"), *t[6:]],
    "coolant elsewhere": lambda t: [*t[:4], "M8", *[line.replace("M8", "") for line in t[4:]]],
}  # fmt: skip


@pytest.mark.parametrize("how", SPOILT)
def test_a_spoilt_program_is_not_within(how: str) -> None:
    """The check finds what a wrong writer would do."""
    path = load_gcode((HEAD + "G0 X0 Y0 Z0\nG1 X30 F6000\nG1 Y40 M0\nG1 X0 M8\nM2").splitlines(), name="p")
    found = mill_job(gantry(x=4e-4, y=1e-3), path, "trimming", at=(0, 0, 0))
    text = "\n".join(SPOILT[how](found.program.text.splitlines()))
    assert text != found.program.text
    with pytest.raises(StiffmapError):
        run(found.job, replace(found.program, text=text))


@pytest.mark.parametrize(
    "rows",
    [
        "0,0,5 0,0,0 40,0,0 40,0,5 40,60,5 40,60,0 0,60,0 0,60,5",
        "0,0,0 40,0,0 40,0,5 40,60,5 40,60,0 0,60,0",
        "0,0,5 0,0,0 40,0,0",
        "0,0,0 40,0,0 40,30,0",
    ],
)
def test_a_table_keeps_what_leads_from_cut_to_cut(tmp_path: Path, rows: str) -> None:
    file = tmp_path / "p.csv"
    file.write_text("\n".join(["x_mm,y_mm,z_mm", *rows.split()]) + "\n")
    path = load_path(file)
    found = mill_job(gantry(x=1e-4, y=2.5e-4), path, "trimming", at=(0, 0, 0))
    again = tmp_path / "out.csv"
    again.write_text(found.program.text)
    made = load_path(again)
    want = np.array([[float(v) for v in r.split(",")] for r in rows.split()])
    got = 1e3 * np.vstack([made.start[:1], made.end])
    at = 0
    for point in want:  # every point, in order
        near = np.flatnonzero(np.linalg.norm(got[at:] - point, axis=1) < FAR)
        assert near.size, point
        at += int(near[0])
    assert len(found.program.origin) == len(found.program.path)
    assert 1e3 * made.length.sum() == pytest.approx(1e3 * path.length.sum(), abs=6 * FAR)

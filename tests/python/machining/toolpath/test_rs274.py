"""Programs as LinuxCNC's own interpreter (rs274 of 2.9) runs them: the same way, or both refuse.

`rs274.jsonl` has one program a line, which `HEAD` precedes: its text, whether it has the work offsets, and what rs274 did, which is
null where it refused, else its moves in mm: 0 and the end of a rapid; 1, end, mm/min and rpm of a line; 2, the same and the
centre's two coordinates in the plane and the turns (negative clockwise) of an arc. Moves of no length are left out.
"""

from __future__ import annotations

import json
from math import ceil, pi
from pathlib import Path

import numpy as np
import pytest

from stiffmap.common.errors import FileError
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.path import Kind

HEAD = "G21 G90 G94 G17 G91.1 S6000 M3 F600\nG0 X0 Y0 Z0\n"
OFFSETS = {
    "G54": (0, 0, 0), "G55": (0.01, -0.005, 0.001), "G56": (0.1, 0, 0), "G57": (0, 0.02, 0), "G58": (0, 0, 0.03),
    "G59": (0.001, 0.002, 0.003), "G59.1": (0.004, 0, 0), "G59.2": (0, 0.004, 0), "G59.3": (0, 0, 0.004),
}  # fmt: skip
PROGRAMS = [json.loads(line) for line in Path(__file__).with_name("rs274.jsonl").read_text().splitlines()]
ENDS = {f"{word}\nG1 X50\nM2": [[1, 50, 0, 0, 600, 6000]] for word in ("G15", "G50", "G69")}
"""Fanuc's ends of what is refused, which rs274 does not know: they change no way."""
PRINTED = 3e-3
"""mm: rs274 prints four decimals, of inches too."""


@pytest.mark.parametrize(("text", "offset", "moves"), PROGRAMS, ids=[repr(t) for t, _, _ in PROGRAMS])
def test_same_way_or_both_refuse(text: str, offset: int, moves: list[list[float]] | None) -> None:
    lines, moves = (HEAD + text).split("\n"), ENDS.get(text, moves)
    if moves is None:
        with pytest.raises(FileError, match=r"p, line \d+: "):
            load_gcode(lines, name="p", offsets=OFFSETS if offset else None)
        return
    p = load_gcode(lines, name="p", offsets=OFFSETS if offset else None)
    far = np.abs(p.end - p.start).max(axis=1) * 1e3 > PRINTED
    found = np.flatnonzero(far | (p.kind == Kind.ARC))
    assert [int(k) for k in p.kind[found]] == [m[0] for m in moves]
    for i, (kind, *numbers) in zip(found, moves, strict=True):
        assert 1e3 * p.end[i] == pytest.approx(numbers[:3], abs=PRINTED)
        if kind:
            assert 6e4 * p.feed[i] == pytest.approx(numbers[3], rel=1e-3, abs=0.03)
            assert p.spindle[i] * 30 / pi == pytest.approx(numbers[4])
        if kind == Kind.ARC:
            plane = {2: [0, 1], 1: [2, 0], 0: [1, 2]}[int(p.normal[i])]
            assert 1e3 * p.centre[i][plane] == pytest.approx(numbers[5:7], abs=PRINTED)
            assert np.sign(p.sweep[i]) * ceil(abs(p.sweep[i]) / (2 * pi) - 1e-6) == numbers[7]


def test_only_a_line_feed_ends_a_line(tmp_path: Path) -> None:
    """rs274 takes a carriage return amid a line for a blank; a remark goes on after it and after a line separator of Latin-1."""
    file = tmp_path / "p.ngc"
    file.write_bytes(b"G21 G90 F600\rG0 X1\nG1\rY2 ; a\rG1 X9\r\n(weiter\x85)\r\r\nG1 X5\nM2\n")
    p = load_gcode(file)
    assert (1e3 * p.end).tolist() == [[1, 0, 0], [1, 2, 0], [5, 2, 0]]
    assert p.line.tolist() == [1, 2, 4]


@pytest.mark.parametrize("line", ["G1\xa0X1", "G1 X\uff11", "G1 X\u0661"])
def test_blanks_and_digits_are_those_of_ascii(line: str) -> None:
    with pytest.raises(FileError, match="line 3: expected words such as"):
        load_gcode((HEAD + line).split("\n"), name="p")

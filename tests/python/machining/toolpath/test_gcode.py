"""G-code: the examples and rules of LinuxCNC's documentation, and what is refused."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from stiffmap.common.errors import FileError
from stiffmap.machining.toolpath import load_path
from stiffmap.machining.toolpath.gcode.load import load_gcode
from stiffmap.machining.toolpath.gcode.read import ProgramReader, read_moves
from stiffmap.machining.toolpath.gcode.words import read_block
from stiffmap.machining.toolpath.gcode.write import _lines
from stiffmap.machining.toolpath.path import Kind, Toolpath

HEAD = "G21 G90 G17 G94 S6000 M3 F600\n"


def read(text: str, head: str = HEAD) -> Toolpath:
    return load_gcode((head + text).splitlines(), name="p.ngc")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("g0x +0. 12 34y 7", [("G", 0), ("X", 0.1234), ("Y", 7)]),  # blanks within numbers
        ("G1 X1 (mid) Y2 ; rest", [("G", 1), ("X", 1), ("Y", 2)]),
        ("N10 G2 X10 Y15 R20 Z5", [("N", 10), ("G", 2), ("X", 10), ("Y", 15), ("R", 20), ("Z", 5)]),
        ("g1 x.5 y-.25 f100.", [("G", 1), ("X", 0.5), ("Y", -0.25), ("F", 100)]),
        ("%", []),
        ("(only a comment)", []),
        ("/G1 X2", [("G", 1), ("X", 2)]),
    ],
)
def test_words(text: str, words: list[tuple[str, float]]) -> None:
    assert list(read_block(text, "p", 1).words) == words


def test_lines_and_modes() -> None:
    p = read("G0 X10 Y0 Z5\nG1 Z0\nX20\nG91 X5 Y5\nG90 G20 X1\nG21 G93 G1 X0 F2\n")
    assert (1e3 * p.end[-4:]).tolist() == pytest.approx(
        np.array([[20, 0, 0], [25, 5, 0], [25.4, 5, 0], [0, 5, 0]])
    )
    assert p.feed[2] == pytest.approx(0.01)
    assert p.feed[-1] == pytest.approx(25.4e-3 * 2 / 60)
    assert p.spindle[-1] == pytest.approx(200 * pi)
    assert p.cuts.tolist() == [False, False, True, True, True, True]
    assert p.line.tolist() == [2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize(
    ("text", "length", "sweep", "middle"),
    [
        # quarter by centre, by radius, the long way by a negative radius
        ("G3 X0 Y10 I-10 J0", 5 * pi, 90, (10 / 2**0.5, 10 / 2**0.5, 0)),
        ("G3 X0 Y10 R10", 5 * pi, 90, (10 / 2**0.5, 10 / 2**0.5, 0)),
        ("G3 X0 Y10 R-10", 15 * pi, 270, None),
        ("G2 X0 Y10 I-10", 15 * pi, -270, None),
        ("G2 X0 Y10 R10", 5 * pi, -90, (10 - 10 / 2**0.5, 10 - 10 / 2**0.5, 0)),
        ("G2 X0 Y10 R-10", 15 * pi, -270, (-10 / 2**0.5, -10 / 2**0.5, 0)),
        ("G2 I-10", 20 * pi, -360, (-10, 0, 0)),
        ("G3 I-10 P2", 40 * pi, 720, (10, 0, 0)),
        ("G3 X10 Y0 I-10 Z-3", (400 * pi**2 + 9) ** 0.5, 360, (-10, 0, -1.5)),  # helix
        ("G90.1 G3 X0 Y10 I0 J0", 5 * pi, 90, (10 / 2**0.5, 10 / 2**0.5, 0)),
        ("G91.1 G18 G2 X0 Z10 I-10 K0", 5 * pi, -90, (10 / 2**0.5, 0, 10 / 2**0.5)),
        ("G19 G3 Y10 Z10 J0 K10", 5 * pi, 90, None),
    ],
)
def test_arcs(text: str, length: float, sweep: float, middle: tuple[float, ...] | None) -> None:
    p = read(f"G0 X10 Y0 Z0\n{text}\n")
    assert p.kind[1] == Kind.ARC
    assert 1e3 * p.length[1] == pytest.approx(length, rel=1e-12)
    assert np.degrees(p.sweep[1]) == pytest.approx(sweep)
    ends = p.at([1, 1], [0.0, 1.0])[0]
    assert ends == pytest.approx(np.array([p.start[1], p.end[1]]), abs=1e-15)
    if middle is not None:
        assert 1e3 * p.at([1], [0.5])[0][0] == pytest.approx(middle, abs=1e-12)
    # tangent and curvature against differences, of second order
    s = np.array([0.3])
    errors = []
    for h in (1e-3, 5e-4):
        a, b, c = (p.at([1], s + d)[0][0] for d in (-h, 0, h))
        speed = p.length[1]
        t = (c - a) / (2 * h * speed)
        k = (c - 2 * b + a) / (h * speed) ** 2
        _, tangent, bend = p.at([1], s)
        errors.append(max(np.abs(t - tangent[0]).max(), 1e-3 * np.abs(k - bend[0]).max()))
    assert errors[1] < max(0.3 * errors[0], 1e-8)


def test_offsets_and_machine_coordinates() -> None:
    p = load_gcode(
        (HEAD + "G55 G0 X0 Y0 Z0\nG1 X10\nG53 G0 X1\nG54 G1 X0").splitlines(),
        name="p",
        offsets={"G54": (0, 0, 0), "G55": (0.1, 0, 0.2)},
    )
    assert (1e3 * p.end).tolist() == [[100, 0, 200], [110, 0, 200], [1, 0, 200], [0, 0, 200]]


def test_notes_are_kept() -> None:
    p = load_gcode(["G21 F100 G0 X0 Y0", "G1 X1", "G64 P0.01", "/G1 X2", "M30", "!!"])
    text = " ".join(p.notes)
    for part in ("no M3", "G64", "slash", "Z is never given"):
        assert part in text
    assert len(p) == 3


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("G54 G0 X0\nG1 X10\nG55 G1 X0", "several work offsets and none is given"), ("G0 X0\nG53 G1 X5", "G53 and no work offset is given"),
        ("G54 G0 X0\nG1 X10\nG54 G1 X0", ""), ("G0 X0\nG55 G1 X5", ""),
    ],
)  # fmt: skip
def test_places_that_nobody_told_are_noted(text: str, part: str) -> None:
    notes = " ".join(read(text).notes)
    assert part in notes
    assert ("offset" in notes) == bool(part)
    assert "offset" not in " ".join(
        load_gcode((HEAD + text).splitlines(), offsets={"G54": (0, 0, 0), "G55": (0.1, 0, 0)}).notes
    )


BAD = [
    ("G0 X1", "", "unit is missing"),
    ("G1 X1", "G21 S1 M3\n", "F was never given"),
    ("G1 X1 F0", HEAD, "feed above zero"),
    ("G2 X1 Y1 R0.1", HEAD, "does not close"),
    ("G2 X10 Y1 I5", HEAD, "does not close"),
    ("G2 X1 Y1", HEAD, "without a centre"),
    ("G2 X0 Y0 R5", HEAD, "not its start"),
    ("G2 X1 K1", HEAD, "does not lie in the plane"),
    ("G2 X1 I1 R1", HEAD, "not both"),
    ("G2", HEAD, "without an end"),
    ("G1 X1 I5", HEAD, "go with G2"),
    ("G0 G1 X1", HEAD, "two motions"),
    ("X5", "G21\n", "without a motion"),
    ("G41 D1", HEAD, "cutter radius compensation"),
    ("G81 X1 Z-1 R1", HEAD, "drilling"),
    ("G5 X1 I0 J1 P0 Q1", HEAD, "splines"),
    ("G12 X1", HEAD, "G12: unknown word"),
    ("G50 X1", HEAD, "G50 with other words"),
    ("G50 S2000", HEAD, "G50 with other words"),
    ("G5 P0 X1", HEAD, "G5: splines"),
    ("G68 X0 Y0 R30", HEAD, "G68: rotations of the axes are not read"),
    ("G52 X10", HEAD, "G52: offsets set by the program are not read"),
    ("O10 X1", HEAD, "O words"),
    ("%10 X1", HEAD, "expected words"),
    ("G54.1 P3", HEAD, "offsets beyond G59 (write G54)"),
    ("G154 P3", HEAD, "offsets beyond G59 (write G54)"),
    ("G71", HEAD, "Siemens's mm (write G21)"),
    ("M98 P100", HEAD, "subprograms"),
    ("M66", HEAD, "M66: unknown word"),
    ("o100 call", HEAD, "subprograms"),
    ("#1=5", HEAD, "parameters"),
    ("G1 X[1+2]", HEAD, "expressions"),
    ("G1 A30", HEAD, "rotary"),
    ("G1 X1 Q3", HEAD, "unknown word: Q3"),
    ("G1 X1 X2", HEAD, "given twice"),
    ("G1 X1,5", HEAD, "expected words"),
    ("G1 X1 (open", HEAD, "comment"),
    ("G43", HEAD, "register"),
    ("G93 G1 X1", HEAD, "every move needs its own F"),
    ("G1 X1e5", HEAD, "unknown word: E5"),
    ("G1 X99999999", HEAD, "beyond any machine"),
    ("S-5", HEAD, "speed of zero or more, found S-5"),
    ("T1.5", HEAD, "whole number of zero or more, found T1.5"),
    ("G43 H-1", HEAD, "whole number of zero or more, found H-1"),
    ("G1 X1 N5", HEAD, "N: expected the line's number at its beginning, found 'G1X1N5'"),
    ("G1 X1 P2", HEAD, "unknown word: P2 (expected with G4, G64, G2 or G3)"),
    ("G40 D1", HEAD, "unknown word: D1"),
    ("G94 G1 X1", HEAD, "F was never given, or before G94"),
    ("G2 X0.001 I0.0005", HEAD, "the arc has no radius"),
    ("G2 X10.01 R5", HEAD, "does not close"),
    ("G53", HEAD, "G53 goes with G0 or G1"),
    ("G28 I1", HEAD, "go with G2 or G3, not with G28"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "head", "message"), BAD, ids=[t for t, _, _ in BAD])
def test_refused(text: str, head: str, message: str) -> None:
    with pytest.raises(FileError) as caught:
        read(text + "\nG1 X3", head)
    assert message in str(caught.value)
    assert f"p.ngc, line {1 + head.count(chr(10))}" in str(caught.value)


@pytest.mark.parametrize(
    "line",
    [
        "O0042",
        "o1234 (name)",
        "O0042 ; number",
        ":1001 (ISO)",
        "%1001",
        "%_N_PART_MPF\n;$PATH=/_N_WKS_DIR",
        "/O0042",
        "G15 G17 G40 G49 G50 G67 G69 G80 G90",
        "G05 P10000",
        "G8 P1",
        "G64 P0.02 Q0.01",
        "G64 P0.02",
        "G64 Q0",
        "G187 P3 E0.01",
        "G187 E0.002",
        "G05.1 Q1",
        "G5.1 Q0",
        "G17 G40 G49 G80 G98",
        "G97 S6000 M3",
        "M48",
        "T1 M6",
        "G4 P0.5",
    ],
)
def test_what_everybody_writes(line: str) -> None:
    p = read(f"{line}\nG0 X0 Y0 Z0\nG1 X30\n")
    assert 1e3 * p.length == pytest.approx([0, 30])
    assert not any("P is for" in note for note in p.notes)


@pytest.mark.parametrize(
    "raw",
    [
        "(Ébauche, côté gauche)".encode("latin-1"), "(Fräser Ø12 µm)".encode("latin-1"), "(ébauche)".encode(),
        b"; \xb0\xff\x80", b"(a) \r",
    ],
)  # fmt: skip
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_bytes_of_comments_and_a_mark_do_not_matter(tmp_path: Path, raw: bytes, mark: bytes) -> None:
    file = tmp_path / "p.nc"
    file.write_bytes(mark + b"G21 G90 S6000 M3 F600\n" + raw + b"\nG0 X0 Y0 Z0\nG1 X30\n")
    p = load_path(file)
    assert 1e3 * p.length == pytest.approx([0, 30])
    assert "�" not in "".join(p.text)
    table = tmp_path / "p.csv"
    table.write_bytes(mark + b"x_mm,y_mm,z_mm\n0,0,0\n30,0,0\n")
    assert 1e3 * load_path(table).length == pytest.approx([30])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines(tmp_path: Path, encoding: str, end: str) -> None:
    lines = ["%", "(Fräser Ø12)", "G21 G90 S6000 M3 F600", "G0 X0 Y0 Z0", "G1 X30 ; längs", "Y10", "M30", "%"]
    file = tmp_path / "p.nc"
    file.write_bytes((end.join(lines) + end).encode(encoding))
    p = load_path(file)
    assert 1e3 * p.length == pytest.approx([0, 30, 10])
    assert p.line.tolist() == [4, 5, 6] and list(p.text) == lines


@pytest.mark.parametrize("raw", [b"\xff\xfeG\x001\x00X", b"G\x001\x00X\x001\x00\n"])
def test_a_program_that_is_cut_off_amid_a_letter_of_utf_16(tmp_path: Path, raw: bytes) -> None:
    (tmp_path / "p.nc").write_bytes(raw)
    with pytest.raises(FileError, match=r"p\.nc: begins as UTF-16 and is none \(truncated data"):
        load_path(tmp_path / "p.nc")


@pytest.mark.parametrize("word", ["G28", "G30", "G91 G28 Z0\nG90", "G28 G91 Z0\nG90", "G30 Z5"])
def test_a_reference_point_is_not_known(word: str) -> None:
    p = read(f"G0 X0 Y0 Z5\nG1 X30\n{word}\nG0 X0 Y0 Z5\nG1 Y30\n{word}\n")
    assert 1e3 * p.length[p.cuts] == pytest.approx([30, 30])
    assert any("reference point" in note for note in p.notes)
    with pytest.raises(FileError, match=r"line .*: where .*Z stands after a reference point is not known"):
        read(f"G0 X0 Y0 Z5\nG1 X30\n{word}\nG0 X0 Y0\nG1 Y30\n")


@pytest.mark.parametrize(
    ("text", "length"),
    [("G2 X20 Y0 I10 J0 P2", 30 * pi), ("G3 X0 Y0 I10 J0 P3", 60 * pi), ("G2 X0 Y0 Z-4 I10 J0 P2", (16 + (40 * pi) ** 2) ** 0.5), ("G18 G3 X20 Z0 I10 K0 P2", 30 * pi)],
)  # fmt: skip
def test_turns_of_an_arc_are_no_note(text: str, length: float) -> None:
    p = read(f"G0 X0 Y0 Z0\n{text}\n")
    assert 1e3 * p.length[-1] == pytest.approx(length)
    assert not any("P is for" in note for note in p.notes)


@pytest.mark.parametrize(
    ("text", "speed"),
    [
        ("G20 F10\nG21\nG1 X30", 254), ("G21 F254\nG20\nG1 X3", 254), ("G20 F40\nG21\nG20\nG1 X3", 1016), ("G20 F10\nG21\nF300 G1 X30", 300),
        ("G20 F10\nG21 G1 X30", 254), ("G21 F300\nG21\nG1 X30", 300),
    ],
)  # fmt: skip
def test_a_feed_keeps_its_speed(text: str, speed: float) -> None:
    p = load_gcode(f"G90 S6000 M3\n{text}".splitlines())
    assert 6e4 * p.feed[-1] == pytest.approx(speed)


@pytest.mark.parametrize(
    ("text", "moves"),
    [
        ("%\nG21 F600 G0 X0\nG1 X30\n%\nG1 X90\n!!", 2), ("(head)\n\n%\nG21 F600 G0 X0\nG1 X30\n % \nG1 X90", 2),
        ("G21 F600 G0 X0\nG1 X30\n%\nG1 X90", 2), ("%\n%\nG21 G0 X0", 0), ("%\nG21 F600 G0 X0\nG1 X30 M2\nG1 X90", 2), ("G21 F600 G0 X0\nM30 G1 X30\nG1 X90", 2),
    ],
)  # fmt: skip
def test_where_a_program_ends(text: str, moves: int) -> None:
    if moves:
        assert len(load_gcode(text.splitlines())) == moves
    else:
        with pytest.raises(FileError, match="no moves"):
            load_gcode(text.splitlines())


@pytest.mark.parametrize(
    "line", ["G0 G17 G40 G49 G80 G90", "G80 G0", "G0 G80 X1", "G80 G92.1 G0 X1", "G80 G80 G0"]
)
def test_cycles_are_cancelled_beside_a_motion(line: str) -> None:
    p = read(f"G1 X5\n{line}\nX2\n")
    assert (p.kind[1:] == Kind.RAPID).all()
    assert 1e3 * p.end[-1, 0] == pytest.approx(2)


@pytest.mark.parametrize("line", ["G0 X1 A0. B-0.0", "G0 A0", "G91 G0 X1 A0\nG90", "A0 X1"])
def test_a_rotary_axis_at_zero_turns_nothing(line: str) -> None:
    assert 1e3 * read(f"G0 X0\n{line}\nG1 X2\n").end[-1, 0] == pytest.approx(2)
    with pytest.raises(FileError, match=r"rotary and secondary axes are not read: A0\.5"):
        read(f"G0 X0\n{line}\nG1 X2 A.5\n")


EXCLUSIVE = [
    "G90 G91", "G20 G21", "G17 G18", "G93 G94", "G54 G55", "G90.1 G91.1", "G61 G64", "G43 G49 H1", "M3 M5", "M7 M9", "M0 M30",
    "G28 G53", "G40 G40", "G97 G97", "G4 G53 P1", "G1 G80 G2 X1 R1", "G98 G99", "G90 G90",
]  # fmt: skip


@pytest.mark.parametrize("text", EXCLUSIVE)
def test_two_words_of_one_group(text: str) -> None:
    with pytest.raises(
        FileError, match=r"p\.ngc, line 2: two (words that exclude each other|motions) in one line"
    ):
        read(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("G80\nX5", "without a motion"), ("G0 X1\nG80\nY5", "without a motion"), ("G80 X5", "without a motion"), ("G1 X1\nG80\nG2", "without an end"),
        ("G4 P1 X10", "two lines"), ("G1 X1\nG4 P1 Y10", "two lines"), ("G4 X1", "time of the dwell"), ("G4 P-1", "time of the dwell"),
        ("G1 X1\nG91\nG53 G0 X5", "absolute"), ("G2 X0 Y10 R10\nG53 X5", "G53 goes with"), ("G28 G1 X5", "both take the axes"),
        ("G64 P0.1 G2 X1 Y0 I0.5 J0", "two lines"), ("G28.1", "reference points"), ("O100 sub", "subprograms"), ("o<name> call", "subprograms"),
    ],
)  # fmt: skip
def test_refused_as_linuxcnc_does(text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read(text)


@pytest.mark.parametrize(
    ("text", "rpm"), [("T1 M6", 0), ("M6 M3", 6000), ("M3 S500 M6", 500), ("M4 M6", -6000), ("M6 S500", 0), ("M6\nM3", 6000), ("M0", 6000)]
)  # fmt: skip
def test_a_change_of_tool_stops_the_spindle(text: str, rpm: float) -> None:
    p = read(f"G0 X0 Y0 Z0\n{text}\nG1 X5\n")
    assert p.spindle[-1] * 30 / pi == pytest.approx(rpm)


def test_a_turn_too_small_to_see_is_a_full_one() -> None:
    """LinuxCNC draws no arc of less than a millionth of a radian."""
    p = read("G0 X0 Y0 Z0\nG2 X0.000001 Y0.000001 I5\nG2 X0.000001 Y0.0001 I5\n")
    assert np.degrees(p.sweep[1:]) == pytest.approx([-360, -0.0011], abs=2e-4)


def test_g80_leaves_the_rest() -> None:
    p = read("G0 X0 Y0 Z0\nG1 X30\nG80\nG1 Y30\n")
    assert 1e3 * p.length[p.cuts] == pytest.approx([30, 30])


@pytest.mark.parametrize(
    "line",
    ["G1 X1.5", "X-2 Y3. F300", "G00 X1 Y2 Z3", "N7 G01 Z-.5", "G1X2Y3F20.5", "Y4 (a)", "G0", "F500", "N3", "X1e2", "G1 X0 Y0 Z0 F0", "X99999999", "X1 X2", "", "G1 X--1", "G1 F99999999999 X1"],
)  # fmt: skip
@pytest.mark.parametrize(
    "before",
    [
        "G21 G90 S6000 M3 F600",
        "G20 G91 M3 S1 F9",
        "G21 G93 M3",
        "G21 F600",
        "G21 M3 S5 F60\nG28",
        "G21 M3 S5 F60 G2",
    ],
)
def test_the_quick_way_reads_the_same(line: str, before: str) -> None:
    """A space ahead sends a line the long way."""
    found: list[object] = []
    for ahead in ("", " "):
        reader = ProgramReader("p", {"G54": (0.1, 0, 0)})
        try:
            moves = list(
                read_moves(
                    [
                        *before.split("\n"),
                        "G1 X3" if "G93" not in before else "",
                        ahead + line,
                        ahead + "X7 F8",
                    ],
                    reader,
                )
            )
        except FileError as error:
            found.append(str(error))
        else:
            found.append(
                (
                    [tuple(map(repr, map(list, m[1:4]))) + (m.motion, repr(m[4:])) for m in moves],
                    reader.state.given,
                    reader.moves,
                )
            )
    assert found[0] == found[1]


#: G words of LinuxCNC's quick reference: those that need nothing with them, those that are refused and the word for it.
STANDARD = {
    "": "G0 G1 G17 G18 G19 G20 G21 G40 G49 G54 G55 G56 G57 G58 G59 G59.1 G59.2 G59.3 G61 G61.1 G64 G80 G90 G90.1 G91 G91.1 "
    "G92.1 G92.2 G94 G97 G98 G99",
    "drilling cycles": "G73 G76 G81 G82 G83 G84 G85 G86 G87 G88 G89",
    "cutter radius compensation": "G41 G42",
    "reference points": "G28.1 G30.1",
    "set by the program": "G10 G92",
    "splines": "G5 G5.1",
    "NURBS": "G5.2",
    "threads": "G33",
    "probing": "G38.2",
    "feed per revolution": "G95",
    "constant surface speed": "G96",
    "unknown word": "G6 G22 G44 G60 G100 G118 G118.6 G146",
}  # fmt: skip


@pytest.mark.parametrize(
    ("why", "word"), [(why, w) for why, words in STANDARD.items() for w in words.split()]
)
def test_every_word_of_the_standard_is_read_or_refused_by_its_name(why: str, word: str) -> None:
    if not why:
        p = read(f"G0 X1 Y1 Z1\n{word}\nG21 G90 G0 X2 Y1\n")
        assert 1e3 * p.end[-1] == pytest.approx([2, 1, 1])
        return
    with pytest.raises(FileError, match=why):
        read(f"{word}\nX1 Y1 Z1 F600\n")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("G5.1 X1 Y1 I2 J0", "G5.1: splines are not read"),
        ("G5.1 Q1 X1", "G5.1: splines are not read"),
        ("G5.1", "G5.1: splines are not read"),
        ("G64 E0.01", "unknown word: E0.01"),
        ("G187 Q1", "unknown word: Q1"),
        ("G5.1 Q1 P2", "unknown word: P2"),
        ("G1 X1 E0.4", "unknown word: E0.4"),
    ],
)
def test_words_of_tracking_go_with_its_modes_alone(line: str, words: str) -> None:
    with pytest.raises(FileError, match=words):
        read(f"{line}\nG0 X0 Y0 Z0\n")


def test_tracking_next_to_a_motion_stays_in_the_written_program() -> None:
    lines = _lines(["G187", "P3", "E0.01", "G1", "X10"], ["G1 X10.02", "G1 X10.05"], False)
    assert lines == ["G187 P3 E0.01 G1 X10.02", "G1 X10.05"]

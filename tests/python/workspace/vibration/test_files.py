"""Files of measured responses."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.workspace.vibration.files import read_responses
from stiffmap.workspace.vibration.response_units import response_unit


def test_a_csv_file_is_read_in_its_units(tmp_path):
    path = tmp_path / "tap.csv"
    path.write_text(
        "frequency_Hz,real_m/s2/N,imag_m/s2/N,coherence\n10,-0.5,0.1,0.98\n20,-1.5,0.4,0.97\n30,2,1,0.9\n"
    )
    (one,) = read_responses(path)
    w = 2 * np.pi * np.array([10, 20, 30])
    np.testing.assert_allclose(
        one.receptance, np.array([-0.5 + 0.1j, -1.5 + 0.4j, 2 + 1j]) / -(w**2), rtol=1e-12
    )
    assert one.variance(5)[2] == pytest.approx(0.1 / (2 * 5 * 0.9))


TURN = 2 * np.pi


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("Frequency (Hz),Real (g/N),Imaginary (g/N)", lambda f, r: (f, r.real / 9.80665, r.imag / 9.80665)),
        ("f [Hz],Re [m/s^2/N],Im [m/s^2/N]", lambda f, r: (f, r.real, r.imag)),
        ("Freq [kHz],Mag [m/s²/N],Phase [deg],Coherence", lambda f, r: (f / 1e3, abs(r), np.degrees(np.angle(r)), 0 * f + 0.9)),
        ("frequency_rad/s,phase_rad,magnitude_mm/s2/N", lambda f, r: (TURN * f, np.angle(r) + TURN, 1e3 * abs(r))),
        ("Frequency [Hz],Magnitude [dB re 1 m/s2/N],Phase [deg]", lambda f, r: (f, 20 * np.log10(abs(r)), np.degrees(np.angle(r)))),
        ("f [Hz],Mag [dB mm/s²/N],Phase [rad]", lambda f, r: (f, 20 * np.log10(1e3 * abs(r)), np.angle(r))),
        ("f [Hz],Mag [dB re: 1 g/N],Phase [rad]", lambda f, r: (f, 20 * np.log10(abs(r) / 9.80665), np.angle(r))),
        ("n [U/min];Betrag [dB rel. 1 m/s²/N];Phase [°]", lambda f, r: (60 * f, 20 * np.log10(abs(r)), np.degrees(np.angle(r)))),
        ("omega [rad/s];H1 Ch2/Ch1 Real [m/s²/N];H1 Ch2/Ch1 Imag [m/s²/N]", lambda f, r: (TURN * f, r.real, r.imag)),
        ("Drehzahl [1/min];Apparent mass [kg];Phase [rad]", lambda f, r: (60 * f, 1 / abs(r), -np.angle(r))),
        ("f [Hz];Real [N/(m/s²)];Imag [N/(m/s²)];Coherence [%]", lambda f, r: (f, (1 / r).real, (1 / r).imag, 0 * f + 90)),
        ("f [Hz];Dyn. Steifigkeit [N/µm];Phase [°]", lambda f, r: (f, 1e-6 * (TURN * f) ** 2 / abs(r), np.degrees(np.angle(-1 / r)))),
        ("Frequency (Hz);Magnitude dB (re 1 m/s²/N);Phase (deg)", lambda f, r: (f, 20 * np.log10(abs(r)), np.degrees(np.angle(r)))),
        ("f [Hz];|H| [dB ref 1(m/s²)/N];phase [deg]", lambda f, r: (f, 20 * np.log10(abs(r)), np.degrees(np.angle(r)))),
        ("f [Hz];Gain [dB re 1e-6 m/s²/N];phase [deg]", lambda f, r: (f, 20 * np.log10(1e6 * abs(r)), np.degrees(np.angle(r)))),
        ("f [Hz];H1(f) Real (m/s²/N);H1(f) Imag (m/s²/N)", lambda f, r: (f, r.real, r.imag)),
        ("Frequency (Hz);|A| (mm/s²/N);arg(A) (deg)", lambda f, r: (f, 1e3 * abs(r), np.degrees(np.angle(r)))),
        ("f/Hz;|A|/(m/s²/N);phi/°", lambda f, r: (f, abs(r), np.degrees(np.angle(r)))),
        ("f [Hz];Re{A} [m/s²/N];Im{A} [m/s²/N]", lambda f, r: (f, r.real, r.imag)),
        ("Hz;Abs(A) [m/s²/N];deg", lambda f, r: (f, abs(r), np.degrees(np.angle(r)))),
        ("Linear Frequency Hz;Amplitude m/s2/N;Phase rad", lambda f, r: (f, abs(r), np.angle(r))),
        ("freq_hz;accel_over_force_real_g_per_N;accel_over_force_imag_g_per_N", lambda f, r: (f, r.real / 9.80665, r.imag / 9.80665)),
        ("Frequency [rpm];Amplitude [g/N];Phase [°]", lambda f, r: (60 * f, abs(r) / 9.80665, np.degrees(np.angle(r)))),
    ],
)  # fmt: skip
def test_tables_as_analysers_write_them(tmp_path, head, columns):
    f = np.array([10.0, 20.0, 30.0])
    accelerance = np.array([-0.5 + 0.1j, -1.5 + 0.4j, 2 - 1j])
    path, comma = tmp_path / "tap.csv", ";" if ";" in head else ","
    rows = (comma.join(f"{v:.12f}" for v in row) for row in zip(*columns(f, accelerance), strict=True))
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    (one,) = read_responses(path)
    np.testing.assert_allclose(one.frequency, f, rtol=1e-9)
    np.testing.assert_allclose(one.receptance, accelerance / -((TURN * f) ** 2), rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "frequency,real_m/N,imag_m/N\n1,1,0\n2,1,0\n",
            "frequency: expected frequencies in Hz, kHz, rad/s or rpm",
        ),
        ("f_Hz,magnitude_m/N,phase\n1,1,0\n2,1,0\n", "phase: the unit is missing: write phase_deg"),
        (
            "10,1e-6,-1e-8\n20,2e-6,-2e-8\n",
            "no header line .*expected its names of columns, such as frequency_Hz, real_m/N, imag_m/N",
        ),
        ("f_Hz,magnitude_dB,phase_deg\n1,1,0\n2,1,0\n", "expected what 0 dB is"),
        ("f_Hz,magnitude_m/N,phase_deg\n1,-100,0\n2,-101,0\n", "expected a size of zero or more"),
        ("f_Hz,magnitude_m/N,imag_m/N\n1,1,0\n2,1,0\n", "expected the columns"),
        ("f_Hz,real_m/N,imag_m/N,phase_deg\n1,1,0,0\n2,1,0,0\n", "expected the columns"),
        ("f_Hz,magnitude_m/N\n1,1\n2,1\n", "expected the columns"),
        (
            "frequency_Hz,real_m/N,imag_m/N\n10,1,0\n5,1,0\n",
            "rising frequencies .* entry 2 is 5 after 10",
        ),
        (
            "frequency_Hz,real_m/N,imag_m/N,coherence\n1,1,0,0.9\n2,1,0,1.4\n",
            "coherence from 0 to 1; point 2 has 1.4",
        ),
        ("frequency_Hz,real_m/N,imag_m/N,coherence\n1,1,0,1\n2,1,0,1\n3,1,0,1\n", "coherence is 1 at every"),
        ("frequency_Hz,real_furlong,imag_furlong\n1,1,0\n2,1,0\n", "UNIT one of m/N"),
        (
            "frequency_Hz,real_m/N,imag_m/N\n1,1,0\n2,high,0\n",
            "line 3: column 'real_m/N': expected a number; found 'high'",
        ),
    ],
)
def test_bad_files_are_one_message(tmp_path, text, message):
    path = tmp_path / "tap.csv"
    path.write_text(text)
    with pytest.raises(sm.StiffmapError, match=message):
        read_responses(path)


@pytest.mark.parametrize("ending", ["txt", "asc", "dat"])
def test_an_analyser_writes_texts(ending, tmp_path):
    path = tmp_path / f"tap.{ending}"
    head = (
        "Project: A\nAverages: 16\n\nFrequenz\tRealteil\tImaginärteil\tKohärenz\nHz\t(m/s²)/N\t(m/s²)/N\t-\n"
    )
    path.write_text(head + "10,5\t-0,5\t0,25\t0,98\n20\t1,5\t-0,25\t0,97\n", encoding="utf-8")
    (one,) = read_responses(path)
    expected = np.array([-0.5 + 0.25j, 1.5 - 0.25j]) / -((TURN * np.array([10.5, 20])) ** 2)
    np.testing.assert_allclose(one.receptance, expected)


def test_a_universal_file_without_marks_is_none(tmp_path):
    path = tmp_path / "tap.unv"
    path.write_text("frequency_Hz,real_m/N,imag_m/N\n1,1,0\n2,1,0\n")
    with pytest.raises(sm.StiffmapError, match=r"universal file .* no mark -1 in it; a table ends in \.csv"):
        read_responses(path)


def test_a_universal_file_is_read(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    f = np.linspace(1, 50, 50)
    values = 1e-6 / (1 - (f / 20) ** 2 + 0.04j * f / 20)
    file = pyuff.UFF(str(tmp_path / "tap.uff"))
    for kind, data in ((4, values * -((2 * np.pi * f) ** 2)), (6, 0.95 + 0 * f + 0j)):
        file.write_sets(
            pyuff.prepare_58(
                func_type=kind, rsp_node=3, rsp_dir=3, ref_node=1, ref_dir=-1, data=data, x=f, id1="tap",
                ordinate_spec_data_type=12, abscissa_spacing=0, orddenom_spec_data_type=13, binary=0,
            ), "add",
        )  # fmt: skip
    (one,) = read_responses(tmp_path / "tap.uff")
    np.testing.assert_allclose(one.receptance, values, rtol=1e-4)
    assert (one.response, one.reference) == ("3 +z", "1 -x")
    np.testing.assert_allclose(one.coherence, 0.95, rtol=1e-6)


def _lines(rows: list[str]) -> list[list[str]]:
    """Lines of each data set of a universal file."""
    ends = [i for i, row in enumerate(rows) if row.strip() == "-1"]
    return [rows[a : b + 1] for a, b in zip(ends[::2], ends[1::2], strict=True)]


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda one, two: (one[:-3] + one[-2:], two), "expected 20 points, .* found 1"),
        (lambda one, two: (one[:18] + one[19:], two), "expected 20 points, .* found 1"),
        (lambda one, two: (one[:20] + one[19:], two), "expected 20 points, .* found 2"),
        (lambda one, two: (one, two[:-3] + two[-2:]), "expected 20 points, .* found 1"),
        (lambda one, two: ([r.replace("        20", "        19", 1) for r in one], two), "expected 19 points"),
        (lambda one, two: (one, [r.replace("        20", "        21", 1) for r in two]), "expected 21 points"),
        (lambda one, two: ([r.replace("        20", "          ", 1) for r in one], two), "tap.uff: .*expected"),
        (lambda one, two: (one, [r.replace("1.00000e+00  1.", "2.00000e+00  1.", 1) for r in two]), "same 20"),
        (lambda one, two: (one[:16] + [one[16][:13] + "         nan " + one[16][26:]] + one[17:], two), "tap.uff: "),
    ],
    ids=["last", "middle", "twice", "coherence", "fewer", "more", "none", "elsewhere", "nan"],
)  # fmt: skip
def test_a_universal_file_that_is_not_whole_is_one_message(harm, message, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    f, path = np.arange(1.0, 21.0), tmp_path / "tap.uff"
    for kind, data in ((4, 1e-3 / (1 + 0.1j * f)), (6, 0.95 + 0 * f)):
        pyuff.UFF(str(path)).write_sets(
            pyuff.prepare_58(
                func_type=kind, rsp_node=3, rsp_dir=3, ref_node=1, ref_dir=-1, data=data + 0j, x=f, id1="tap",
                ordinate_spec_data_type=12, abscissa_spacing=1, abscissa_min=1.0, abscissa_inc=1.0,
                orddenom_spec_data_type=13, binary=0,
            ), "add",
        )  # fmt: skip
    assert len(read_responses(path)[0].frequency) == 20
    sets = harm(*_lines(path.read_text().splitlines()))
    path.write_text("".join(f"{row}\n" for rows in sets for row in rows))
    with pytest.raises(sm.StiffmapError, match=message) as problem:
        read_responses(path)
    assert str(path) in str(problem.value)


MASS, STIFFNESS, DAMPING = 2.0, 1e6, 0.02
F = np.arange(1, 42) * 0.5
W = 2 * np.pi * F
RECEPTANCE = 1 / (STIFFNESS - MASS * W**2 + 2j * DAMPING * np.sqrt(STIFFNESS * MASS) * W)
ACCELERANCE = -(W**2) * RECEPTANCE


def universal(
    path, data, above=(12, "m/s2"), below=(13, "N"), along=(18, "Hz"), *, base=None, fill=False, name=""
):
    """A universal file with one response, written line by line from the description of its format."""
    lines = []
    if base is not None:
        code, length, force = base
        lines += ["    -1", "   164", f"{code:10d}{'units':20s}{2:10d}"]
        lines += [
            "".join(f"{x:25.17E}".replace("E", "D") for x in (length, force, 1.0)),
            f"{273.15:25.17E}",
            "    -1",
        ]
    lines += ["    -1", "    58", "tap 1", "NONE", "25-Nov-26 10:00:00", "NONE", "NONE"]
    lines.append(f"{4:5d}{1:10d}{1:5d}{0:10d} {'NONE':10s}{1:10d}{1:4d} {'NONE':10s}{1:10d}{1:4d}")
    lines.append(f"{5:10d}{len(data):10d}{1:10d}{0.5:13.5E}{0.5:13.5E}{0.0:13.5E}")
    for kind, unit in (along, above, below, (0, "NONE")):
        lines.append(f"{kind:10d}{0:5d}{0:5d}{0:5d} {name or 'NONE':20s} {unit:20s}")
    flat = [x for c in data for x in (c.real, c.imag)]
    flat += [0.0] * (-len(flat) % 6 if fill else 0)
    lines += ["".join(f"{x:13.5E}" for x in flat[i : i + 6]) for i in range(0, len(flat), 6)]
    path.write_text("\n".join([*lines, "    -1"]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("data", "axes"),
    [
        (ACCELERANCE, {}),
        (ACCELERANCE / 9.80665, {"above": (12, "g")}),
        (ACCELERANCE / 9.80665, {"above": (12, "g/N"), "below": (0, "NONE")}),
        (ACCELERANCE / 9.80665, {"above": (12, "g/N")}),
        (ACCELERANCE * 4.4482216, {"below": (13, "lbf")}),
        (ACCELERANCE / 0.0254 * 4.4482216, {"above": (12, "in/s^2"), "below": (13, "lbf")}),
        (1j * W * RECEPTANCE / 0.0254, {"above": (11, "ips")}),
        (ACCELERANCE * 1e6, {"above": (12, "mm/s²"), "below": (9, "kN")}),
        (ACCELERANCE, {"above": (1, "(1/N)*(m/s²)"), "below": (0, "NONE")}),
        (ACCELERANCE, {"above": (0, "(m/s2)/N"), "below": (0, "NONE")}),
        (ACCELERANCE, {"above": (12, "NONE"), "below": (13, "")}),
        (ACCELERANCE / 9.80665, {"above": (12, "NONE"), "name": "acc (g)", "below": (13, "N")}),
        (ACCELERANCE * 1e3, {"above": (12, ""), "below": (13, ""), "base": (5, 1e3, 1.0)}),
        (ACCELERANCE * 1e3 / 1e3, {"above": (12, ""), "below": (13, ""), "base": (5, 1e3, 1e3)}),
        (ACCELERANCE * 1e3, {"above": (12, "mm/s2"), "base": (2, 3.28083989501312, 0.224808943)}),
        (RECEPTANCE * 1e3, {"above": (8, "mm")}),
        (RECEPTANCE * 1e6, {"above": (8, "\N{MICRO SIGN}m")}),
        (1j * W * RECEPTANCE * 1e3, {"above": (11, "mm/s")}),
        (RECEPTANCE, {"above": (8, "m"), "along": (18, "rad/s")}),
        (ACCELERANCE, {"fill": True}),
    ],
)  # fmt: skip
def test_universal_files_are_read_in_their_units(data, axes, tmp_path):
    pytest.importorskip("pyuff")
    (one,) = read_responses(universal(tmp_path / "tap.uff", data, **axes))
    assert len(one.frequency) == len(F)
    np.testing.assert_allclose(one.frequency, F / (2 * np.pi if "along" in axes else 1), rtol=1e-9)
    np.testing.assert_allclose(one.receptance, RECEPTANCE, rtol=2e-5)


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"below": (12, "m/s2")}, "divided by a force .* an acceleration"),
        ({"below": (8, "m")}, "divided by a force .* a displacement"),
        ({"below": (15, "Pa")}, "divided by a force .* a pressure"),
        ({"below": (0, "NONE")}, "expected the force"),
        ({"below": (13, "V")}, "unit that is known.* found 'V'"),
        ({"above": (12, "EU")}, "unit that is known.* found 'EU'"),
        ({"above": (12, "dB")}, "unit that is known.* found 'dB'"),
        ({"above": (12, "mm")}, "acceleration .* by force.* found 'mm' by 'N'"),
        ({"above": (8, "m/s2")}, "displacement .* by force.* found 'm/s2' by 'N'"),
        ({"above": (1, "g2/N2"), "below": (0, "NONE")}, "found 'g2/N2'"),
        ({"above": (15, "Pa")}, "found a pressure"),
        ({"along": (17, "s")}, "frequencies .* found a time"),
        ({"along": (18, "s")}, "found 's'"),
        ({"above": (12, ""), "base": (1, 3.28, 0.2248)}, "says SI, but 3.28"),
    ],
)
def test_universal_files_that_say_no_response_by_force_are_one_message(axes, message, tmp_path):
    pytest.importorskip("pyuff")
    path = universal(tmp_path / "tap.uff", ACCELERANCE, **axes)
    with pytest.raises(sm.StiffmapError, match=message) as problem:
        read_responses(path)
    assert str(problem.value).startswith(
        f"{path}: response tap 1: expected" if "base" not in axes else f"{path}"
    )


@pytest.mark.parametrize(
    ("unit", "size"), [("mm/s2/N", 1e-3), ("g/lbf", 9.80665 / 4.4482216), ("in/s^2/kN", 2.54e-5)]
)
def test_a_csv_file_may_have_any_unit_of_a_response_by_force(unit, size, tmp_path):
    path = tmp_path / "tap.csv"
    rows = "".join(
        f"{f},{float(a.real / size)},{float(a.imag / size)}\n" for f, a in zip(F, ACCELERANCE, strict=True)
    )
    path.write_text(f"frequency_Hz,real_{unit},imag_{unit}\n{rows}")
    np.testing.assert_allclose(read_responses(path)[0].receptance, RECEPTANCE, rtol=1e-6)


@pytest.mark.parametrize("word", ["Mn", "m/s^", "(m", "N)", "m/N-s2", "m/ss", "furlong", "1" * 200])
def test_a_unit_that_is_not_known_is_none(word):
    assert response_unit(word) is None


@pytest.mark.parametrize("binary", [0, 1])
def test_units_of_files_that_pyuff_writes(binary, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    base = {"units_code": 1, "units_description": "SI", "temp_mode": 1, "temp": 1.8, "temp_offset": 459.67}
    file = pyuff.UFF(str(tmp_path / "tap.uff"))  # the factors are those of feet and pounds: the labels count
    file.write_sets(
        pyuff.prepare_164(length=3.28083989501312334, force=0.224808943099710480, **base), "overwrite"
    )
    file.write_sets(
        pyuff.prepare_58(
            func_type=4, rsp_node=3, rsp_dir=3, ref_node=1, ref_dir=-1, data=ACCELERANCE / 9.80665, x=F, id1="tap",
            ordinate_spec_data_type=12, ordinate_axis_units_lab="g/N", abscissa_spacing=0, orddenom_spec_data_type=13,
            binary=binary,
        ), "add",
    )  # fmt: skip
    np.testing.assert_allclose(read_responses(tmp_path / "tap.uff")[0].receptance, RECEPTANCE, rtol=2e-5)


def _function(tmp_path, values, **head):
    """One data set 58 as pyuff writes it."""
    pyuff = pytest.importorskip("pyuff")
    path, at = (
        tmp_path / "one.uff",
        {"rsp_node": 3, "rsp_dir": 3, "ref_node": 1, "ref_dir": -1, "func_type": 4},
    )
    kinds = {"ordinate_spec_data_type": 8, "orddenom_spec_data_type": 13, "abscissa_spacing": 0, "binary": 0}
    path.unlink(missing_ok=True)  # pyuff overwrites a file with an empty one where it is binary
    pyuff.UFF(str(path)).write_sets(
        pyuff.prepare_58(**{**at, **kinds, "data": values, "x": F, "id1": "tap", **head}), "add"
    )
    return path.read_bytes()


def test_hits_between_the_same_ends_keep_their_own_coherence(tmp_path):
    pytest.importorskip("pyuff")
    known = {c: _function(tmp_path, c + 0 * RECEPTANCE.real, func_type=6) for c in (0.95, 0.8)}
    hits = [_function(tmp_path, k * RECEPTANCE, id1=f"tap {k}") for k in (1, 2)]
    path = tmp_path / "taps.uff"
    for order, expected in (
        ((hits[0], known[0.95], hits[1], known[0.8]), (0.95, 0.8)),
        ((*hits, *known.values()), (0.95, 0.8)),
        ((*hits, known[0.95]), (0.95, 0.95)),
    ):
        path.write_bytes(b"".join(order))
        assert [one.coherence[0] for one in read_responses(path)] == pytest.approx(expected)
    path.write_bytes(b"".join((hits[0], *known.values())))
    with pytest.raises(sm.StiffmapError, match=r"3 .z by 1 -x: found 2 coherences of 1 responses"):
        read_responses(path)


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("cut", [1, 8, 60, 800])
def test_a_universal_file_that_is_cut_off_is_one_message(cut, binary, tmp_path):
    pytest.importorskip("pyuff")
    whole = b"".join(
        _function(tmp_path, RECEPTANCE, id1=f"tap {k}", binary=binary).rstrip() + b"\n" for k in (1, 2)
    )
    path = tmp_path / "taps.uff"
    path.write_bytes(whole)
    assert len(read_responses(path)) == 2
    path.write_bytes(whole[: -cut - 1])
    with pytest.raises(sm.StiffmapError, match="found 3 marks -1 for 1: it is cut off"):
        read_responses(path)


@pytest.mark.parametrize(
    ("values", "head", "message"),
    [
        (np.abs(RECEPTANCE), {}, "expected complex numbers"),
        (np.abs(RECEPTANCE), {"func_type": 2}, "no frequency response"),
    ],
)
def test_a_function_without_phase_is_no_response(values, head, message, tmp_path):
    path = tmp_path / "tap.uff"
    path.write_bytes(_function(tmp_path, values, **head))
    with pytest.raises(sm.StiffmapError, match=message):
        read_responses(path)


@pytest.mark.parametrize("head", ["coherence [%]", "coherence_%", "coherence in percent"])
def test_a_coherence_in_percent_is_read(head, tmp_path):
    (tmp_path / "tap.csv").write_text(f"frequency_Hz,real_m/N,imag_m/N,{head}\n1,1,0,90\n2,1,0,95\n")
    np.testing.assert_allclose(read_responses(tmp_path / "tap.csv")[0].coherence, [0.9, 0.95])


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ("accelerance [m/N],phase [deg]", "expected a unit of accelerance; found m/N"),
        ("accelerance_m/N,phase_deg", "expected a unit of accelerance; found m/N"),
        ("mobility_m/s2/N,phase_deg", "expected a unit of mobility; found m/s2/N"),
        ("receptance_g/N,phase_deg", "expected a unit of receptance; found g/N"),
        ("dynamic stiffness [um/N],phase [deg]", "expected a unit of stiffness; found um/N"),
        ("real [N/m],imag [N/m]", "line 2: real .*expected a force by a motion above zero"),
        ("gain [dB],phase [deg]", "expected what 0 dB is"),
    ],
)
def test_a_response_that_contradicts_its_name_is_refused(columns, message, tmp_path):
    (tmp_path / "tap.csv").write_text(f"frequency_Hz,{columns}\n1,0,0\n2,1,0\n")
    with pytest.raises(sm.StiffmapError, match=message):
        read_responses(tmp_path / "tap.csv")


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("Frequency (Hz),Accelerance (m/s^2/N),Phase (deg)", lambda a: (abs(a), np.degrees(np.angle(a)))),
        ("f [Hz],Re(H) [mm/s²/N],Im(H) [mm/s²/N]", lambda a: (1e3 * a.real, 1e3 * a.imag)),
        ("Freq (Hz),Real Part (m/s2/N),Imaginary Part (m/s2/N),Coh", lambda a: (a.real, a.imag, 0 * abs(a) + 0.9)),
        ("f [Hz],Accelerance [(m/s^2)/N],Phase [deg]", lambda a: (abs(a), np.degrees(np.angle(a)))),
        ("Frequenz [Hz],H1 Realteil [m/s²/N],H1 Imaginärteil [m/s²/N]", lambda a: (a.real, a.imag)),
        ("Frequency (Hz),Real ((m/s2)/N),Imaginary ((m/s2)/N)", lambda a: (a.real, a.imag)),
        ("Frequency (Hz),Amplitude ((m/s²)/N),Phase (deg)", lambda a: (abs(a), np.degrees(np.angle(a)))),
        ("Frequency (Hz),TF_Acc/Force/Real ((m/s2)/N),TF_Acc/Force/Imag ((m/s2)/N)", lambda a: (a.real, a.imag)),
        *((f"{name},Real [m/s2/N],Imag [m/s2/N]", lambda a: (a.real, a.imag)) for name in ("f/Hz", "Frequency Hz", "F_Hz", "freq in Hz")),
        (",Frequency (Hz),Real (m/s2/N),Imag (m/s2/N)", lambda a: (a.real, a.imag)),
        ("Unnamed: 0,Frequency (Hz),Real (m/s2/N),Imag (m/s2/N)", lambda a: (a.real, a.imag)),
        ("Line,Frequency (Hz),Real (m/s2/N),Imag (m/s2/N)", lambda a: (a.real, a.imag)),
        ("f [Hz],FRF Real [m/s²/N],FRF Imag [m/s²/N],Magnitude [m/s²/N],Phase [deg]", lambda a: (a.real, a.imag, abs(a), np.degrees(np.angle(a)))),
    ],
)  # fmt: skip
def test_names_of_analysers(header, columns, tmp_path):
    f = np.array([10.0, 20.0, 30.0])
    receptance = np.array([1e-6 - 2e-7j, -1e-6 - 3e-6j, -2e-7 - 1e-7j])
    numbers = [range(3)] * (not header.startswith(("F", "f")))  # of the rows
    rows = np.column_stack([*numbers, f, *columns(-((2 * np.pi * f) ** 2) * receptance)])
    text = "\n".join(",".join(map(repr, row.tolist())) for row in rows)
    (tmp_path / "r.csv").write_text(f"{header}\n{text}\n", encoding="utf-8")
    (one,) = read_responses(tmp_path / "r.csv")
    np.testing.assert_allclose(one.receptance, receptance, rtol=1e-12)


@pytest.mark.parametrize("size", [1.0, -1.0], ids=["at the tool", "across"])
@pytest.mark.parametrize("power", [0, 1, 2])
@pytest.mark.parametrize("head", ["Real [{0}],Imag [{0}]", "Magnitude [{0}],Phase [deg]"])
@pytest.mark.parametrize("damping", [0.06, 0.02, 0.005], ids=["many lines", "three lines", "one line"])
def test_a_phase_that_rises_over_the_peak_is_refused(size, power, head, damping, tmp_path):
    """Some analysers count the lag behind the force, or have exp(-iωt): a mode would be damped otherwise."""
    f = np.arange(4.0, 200.0, 2.0)
    response = size * 1e-7 / (1 - (f / 120) ** 2 + 1j * damping * f / 120) * (2j * np.pi * f) ** power
    for turned in (response, response.conj()):
        polar = "Phase" in head
        pair = (abs(turned), np.angle(turned, deg=True)) if polar else (turned.real, turned.imag)
        lines = [",".join(f"{v:.9g}" for v in row) for row in zip(f, *pair, strict=True)]
        unit = ("m/N", "m/s/N", "m/s²/N")[power]
        (tmp_path / "f.csv").write_text("\n".join([f"f [Hz],{head.format(unit)}", *lines]), encoding="utf-8")
        if turned is response:
            assert len(read_responses(tmp_path / "f.csv")) == 1
    with pytest.raises(
        StiffmapError, match="expected a phase that falls over the peak, found one that rises"
    ):
        read_responses(tmp_path / "f.csv")


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_modes_that_are_close_to_one_another_are_no_rising_phase(step, tmp_path):
    """Their phase may rise between two peaks, seen across."""
    rng = np.random.default_rng(5)
    f = np.arange(20.0, 200.0, step)
    for _ in range(20):
        own, ratio = rng.uniform(60, 90, 4), rng.uniform(0.002, 0.03, 4)
        x = f[:, None] / own
        h = (rng.choice([-1, 1], 4) / (1 - x**2 + 2j * ratio * x)).sum(axis=1)
        h += 0.01 * np.abs(h).max() * (rng.normal(size=len(f)) + 1j * rng.normal(size=len(f)))
        rows = [f"{a},{b.real},{b.imag}" for a, b in zip(f, h, strict=True)]
        (tmp_path / "f.csv").write_text("\n".join(["f [Hz],Real [m/N],Imag [m/N]", *rows]))
        assert len(read_responses(tmp_path / "f.csv")) == 1


def test_a_phase_that_rises_in_a_universal_file_is_refused(tmp_path):
    values = 1e-7 / (1 - (F / F.mean()) ** 2 + 0.2j * F / F.mean())
    _function(tmp_path, values)
    assert len(read_responses(tmp_path / "one.uff")) == 1
    _function(tmp_path, values.conj())
    with pytest.raises(StiffmapError, match="response tap: expected a phase that falls over the peak"):
        read_responses(tmp_path / "one.uff")


@pytest.mark.parametrize("axis", ["X [Hz]", "x_Hz", "Linear [Hz]", "Linear Hz"])
def test_what_is_in_hertz_is_the_frequency(axis, tmp_path):
    (tmp_path / "r.csv").write_text(f"{axis},Real [m/N],Imag [m/N]\n10,1e-6,0\n20,2e-6,-1e-6\n")
    assert read_responses(tmp_path / "r.csv")[0].frequency.tolist() == [10.0, 20.0]


def test_a_column_without_a_name_that_counts_no_rows_is_refused(tmp_path):
    (tmp_path / "r.csv").write_text(
        ",f [Hz],Re [m/N],Im [m/N]\n0,1,2,3\n2,2,2,3\n3,3,2,3\n", encoding="utf-8"
    )
    with pytest.raises(StiffmapError, match="unknown column 'column 1'"):
        read_responses(tmp_path / "r.csv")


@pytest.mark.parametrize("degrees", [[0, -20, -170], [179, -179, 170], [-100, -101, -102]])
def test_degrees_are_not_taken_for_radians(degrees, tmp_path):
    for unit, size in (("deg", 1.0), ("rad", np.pi / 180)):
        rows = "".join(f"{10 + k},1e-6,{size * v}\n" for k, v in enumerate(degrees))
        (tmp_path / f"{unit}.csv").write_text(f"frequency_Hz,receptance_m/N,phase_{unit}\n{rows}")
        (one,) = read_responses(tmp_path / f"{unit}.csv")
        np.testing.assert_allclose(np.exp(1j * np.radians(degrees)), 1e6 * one.receptance, rtol=1e-9)
    (tmp_path / "mixed.csv").write_text((tmp_path / "deg.csv").read_text().replace("phase_deg", "phase_rad"))
    with pytest.raises(sm.StiffmapError, match="phase_rad: expected steps of a turn at most"):
        read_responses(tmp_path / "mixed.csv")


@pytest.mark.parametrize("unit", ["m/N", "m/s/N", "m/s2/N", "N/m"])
def test_phases_in_the_unit_of_the_other_header_are_refused(unit, tmp_path):
    """One mass on a spring: whatever is measured of it, the phase turns by half a turn over its peak."""
    f = np.linspace(5.0, 100.0, 1500)
    power = {"m/N": 0, "m/s/N": 1, "m/s2/N": 2, "N/m": 0}[unit]
    h = (TURN * 1j * f) ** power * 1e-6 / (1 - (f / 40) ** 2 + 0.06j * f / 40)
    h = 1 / h if unit == "N/m" else h
    for phase, other in ((np.angle(h), "deg"), (np.degrees(np.unwrap(np.angle(h)))[f < 39], "rad")):
        rows = "".join(f"{a},{abs(b)},{c}\n" for a, b, c in zip(f, h, phase, strict=False))
        file = tmp_path / "phase.csv"
        file.write_text(f"frequency_Hz,magnitude_{unit},phase_{other}\n{rows}")
        with pytest.raises(sm.StiffmapError, match=r"phase_\w+: expected"):
            read_responses(file)
        file.write_text(f"frequency_Hz,magnitude_{unit},phase_{'rad' if other == 'deg' else 'deg'}\n{rows}")
        np.testing.assert_allclose(read_responses(file)[0].receptance[0], 1e-6, rtol=0.03)


@pytest.mark.parametrize("other", [3.0, 1j, 0.5])
def test_two_forms_of_one_response_agree(other, tmp_path):
    """Of another channel they do not."""
    h = 1e-6 / (1 - (np.arange(5.0, 80) / 40) ** 2 + 0.06j)
    file = tmp_path / "two.csv"
    for factor in (1.0, other):
        m = factor * h
        rows = "".join(
            f"{k + 5},{a.real},{a.imag},{abs(b)},{np.degrees(np.angle(b))}\n"
            for k, (a, b) in enumerate(zip(h, m, strict=True))
        )
        file.write_text(f"frequency_Hz,real_m/N,imag_m/N,magnitude_m/N,phase_deg\n{rows}")
        if factor == 1.0:
            np.testing.assert_allclose(read_responses(file)[0].receptance, h)
    with pytest.raises(sm.StiffmapError, match="expected one response, found two"):
        read_responses(file)


@pytest.mark.parametrize("size", ["magnitude_dB", "magnitude [dB re 1 m/N]", "magnitude_m/N"])
def test_a_second_form_may_be_in_decibels(size, tmp_path):
    h = 1e-6 / (1 - (np.arange(5.0, 80) / 40) ** 2 + 0.06j)
    m = abs(h) if size.endswith("_m/N") else 20 * np.log10(abs(h))
    lines = zip(h.real, h.imag, m, np.degrees(np.angle(h)), strict=True)
    rows = "".join(f"{k + 5},{','.join(map(str, line))}\n" for k, line in enumerate(lines))
    (tmp_path / "db.csv").write_text(f"frequency_Hz,real_m/N,imag_m/N,{size},phase_deg\n{rows}")
    np.testing.assert_allclose(read_responses(tmp_path / "db.csv")[0].receptance, h)


H1 = "Frequency [Hz];H1 Ch2/Ch1 Real [m/N];H1 Ch2/Ch1 Imag [m/N];H1 Ch3/Ch1 Real [m/N];H1 Ch3/Ch1 Imag [m/N]"


@pytest.mark.parametrize(
    ("head", "rows"),
    [
        (H1, "{0};{1};{2};{3};{4}"),
        (
            "Frequency;FRF X;;FRF Y;\n;Real;Imag;Real;Imag\n[Hz];[m/N];[m/N];[m/N];[m/N]",
            "{0};{1};{2};{3};{4}",
        ),
        ("Frequency;FRF;FRF\n[Hz];[m/N];[m/N]", "{0};{1}{2:+}i;{3}{4:+}i"),
        ("Frequency;FRF;;FRF;\n[Hz];[m/N];[m/N];[m/N];[m/N]", "{0};{1};{2};{3};{4}"),
        (
            "Frequency [Hz];Real [m/N];Imag [m/N];Frequency [Hz];Real [m/N];Imag [m/N]",
            "{0};{1};{2};{0};{3};{4}",
        ),
    ],
)
@pytest.mark.parametrize("comma", [False, True])
def test_several_responses_in_one_table(tmp_path, head, rows, comma):
    f = np.arange(5.0, 20.0)
    H = np.array([s / (1 - (f / 12) ** 2 + 0.01j * f) for s in (1.5, 2.5)])
    text = "\n".join(rows.format(a, x.real, x.imag, y.real, y.imag) for a, x, y in zip(f, *H, strict=True))
    (tmp_path / "r.csv").write_text(f"{head}\n{text.replace('.', ',') if comma else text}\n")
    found = read_responses(tmp_path / "r.csv")
    np.testing.assert_allclose([r.receptance for r in found], H)
    assert [r.name for r in found] == ["r 1", "r 2"]


def test_one_coherence_of_two_responses_is_of_neither(tmp_path):
    (tmp_path / "r.csv").write_text(f"{H1};Coherence\n5;1;0;1;0;1\n6;1;0;1;0;1\n")
    with pytest.raises(StiffmapError, match="Coherence: expected a coherence of each of 2 responses"):
        read_responses(tmp_path / "r.csv")


@pytest.mark.parametrize(
    "head",
    ["Freq.,Accelerance Real (1/kg),Accelerance Imag (1/kg)", "Hz,H1 X Real [m/s2/N],H1 X Imaginär [m/s2/N]", "Freq_Hz,Re_m/s2_per_N,Im_m/s2_per_N"],
)  # fmt: skip
def test_a_name_ends_with_its_part(head, tmp_path):
    path = tmp_path / "r.csv"
    head = head.replace("Freq.", "Freq. [Hz]")
    path.write_text(f"{head}\n10,1,2\n20,3,4\n30,5,6\n", encoding="utf-8")
    (one,) = read_responses(path)
    np.testing.assert_allclose(one.receptance[1], (3 + 4j) / (40j * np.pi) ** 2)

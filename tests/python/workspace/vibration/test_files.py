"""Files of measured responses."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.workspace.vibration.files import read_responses


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "frequency_Hz,real_m/N,imag_m/N\n10,1,0\n5,1,0\n",
            "rising frequencies; point 2 has 5 Hz after 10 Hz",
        ),
        (
            "frequency_Hz,real_m/N,imag_m/N,coherence\n1,1,0,0.9\n2,1,0,1.4\n",
            "coherence from 0 to 1; point 2 has 1.4",
        ),
        ("frequency_Hz,real_m/N,imag_m/N,coherence\n1,1,0,1\n2,1,0,1\n3,1,0,1\n", "coherence is 1 at every"),
        ("frequency_Hz,real_furlong,imag_furlong\n1,1,0\n2,1,0\n", "UNIT one of m/N"),
        (
            "frequency_Hz,real_m/N,imag_m/N\n1,1,0\n2,high,0\n",
            "line 3: real_m/N: expected a number, found 'high'",
        ),
    ],
)
def test_bad_files_are_one_message(tmp_path, text, message):
    path = tmp_path / "tap.csv"
    path.write_text(text)
    with pytest.raises(sm.StiffmapError, match=message):
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

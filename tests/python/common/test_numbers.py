"""Numbers are bounded where they are read: what is enormous is refused by name, dust is zero, warnings are one line."""

from __future__ import annotations

import base64
import shutil
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest

from stiffmap.common import yaml_text
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import (
    LARGEST,
    SMALLEST,
    bounded,
    length_text,
    number_in,
    percent,
    percents,
    read_value,
    vector_text,
    with_uncertainty,
)
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.ui.cli import main
from stiffmap.ui.view.state import ViewState, from_permalink, permalink

ENORMOUS = ["1e160", "-1e61", "1" + 300 * "0"]
DUST = ["1e-300", "-1e-114", "5e-324"]
ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("text", ENORMOUS)
def test_what_is_enormous_is_refused_by_every_reader(text: str) -> None:
    for read in (number_in, lambda t: yaml_text.parse(f"a: [0, {t}]"), lambda t: read_value(f"{t} m", "m")):
        with pytest.raises(StiffmapError, match=r"at most|neither endless nor enormous"):
            read(text)
    with pytest.raises(StiffmapError, match="at most"):
        Cells.of(["1", text]).numbers(lambda cell, row: number_in(cell))


@pytest.mark.parametrize("text", DUST)
def test_dust_is_zero_to_every_reader(text: str) -> None:
    assert number_in(text) == 0.0
    assert yaml_text.parse(f"a: {text}").data == {"a": 0.0}
    assert read_value(f"{text} m", "m") == 0.0
    np.testing.assert_array_equal(Cells.of(["1", text]).numbers(lambda cell, row: 7.0), [1.0, 0.0])


def test_what_is_within_the_bounds_is_exact() -> None:
    for value in (LARGEST, -LARGEST, SMALLEST, 0.1, np.inf, -np.inf):
        assert bounded(value) == value
        assert yaml_text.parse(f"a: {str(value).replace('inf', '.inf')}").data["a"] == value


@pytest.mark.parametrize(
    ("share", "text"),
    [(1.0, "100 %"), (0.9984, "100 %"), (0.994, "99 %"), (0.138, "14 %"), (0.00097, "0.097 %"), (0.0, "0 %")],
)
def test_shares_have_two_digits_and_no_powers(share: float, text: str) -> None:
    assert percent(share) == text


@pytest.mark.parametrize("noise", ["1e160", "1e-300"])
@pytest.mark.parametrize("command", ["residual", "calibrate"])
def test_noise_of_any_size_is_no_defect(
    noise: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "tests/data/experiments/C-backlash", tmp_path / "e")
    file = tmp_path / "e/experiment.yaml"
    text = file.read_text()
    assert "0.003" in text
    file.write_text(text.replace("0.003", noise))
    code = main([command, "orthoglide-revised", str(tmp_path / "e")])
    error = capsys.readouterr().err
    assert code in (1, 2)
    assert len(error.splitlines()) == (1 if code == 2 else 0)


def test_a_number_of_a_link_to_the_view_is_bounded() -> None:
    valid = b'"position":[0.0,0.0,0.0]'
    packed = permalink("orthoglide-revised", ViewState((0.0, 0.0, 0.0)))
    text = zlib.decompress(base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4)))
    assert valid in text
    for wrong in (b'"position":[0.0,0.0,1e300]', valid + b',"tolerance":1' + 400 * b"0"):
        word = base64.urlsafe_b64encode(zlib.compress(text.replace(valid, wrong))).decode().rstrip("=")
        with pytest.raises(StiffmapError, match=r"at most|finite"):
            from_permalink(word)


def test_warnings_of_a_command_are_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def noisy(_: object) -> None:
        warnings.warn("two\nlines", UserWarning, stacklevel=1)
        warnings.warn("of a library", RuntimeWarning, stacklevel=1)

    monkeypatch.setattr("stiffmap.model.effects.load_effects", noisy)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["--effects-from", "mine.py", "machines"]) == 0
    assert capsys.readouterr().err == "stiffmap: two lines\n"


@pytest.mark.parametrize(
    ("text", "cells"),
    [
        ("id,x,y,note\na,1.5,2.5,ok; warm; slow\nb,2.5,3.5,cold; late; x\n", ("a", "1.5", "2.5", "ok; warm; slow")),
        ("id;x;y;note\na;1,5;2,5;ok, warm, slow\nb;2,5;3,5;cold, late, x\n", ("a", "1,5", "2,5", "ok, warm, slow")),
        ("id|x|y\na|1|2\nb|3|4\n", ("a", "1", "2")),
        ("id\tx\ty\na, b\t1,5\t2\nc; d\t3\t4,5\n", ("a, b", "1,5", "2")),
        ('id,x,y,note\na,1,2,"1;2;3;4;5;6"\nb,2,3,"1;2;3;4;5;6"\n', ("a", "1", "2", "1;2;3;4;5;6")),
    ],
)  # fmt: skip
def test_the_separator_is_what_parts_numbers(text: str, cells: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    assert next(zip(*read_sheet(tmp_path / "t.csv").columns, strict=True)) == cells


def test_percents_sum_to_the_whole() -> None:
    assert percents([0.525, 0.445, 0.03]) == [53, 44, 3] and percents([1 / 3] * 3) == [34, 33, 33]
    assert percents([]) == [] and sum(percents([0.6, 0.55, -0.15])) == 100


@pytest.mark.parametrize(
    ("size", "text"),
    [(932.46e-6, "932.5 µm"), (999.96e-6, "1.000 mm"), (12.1893e-3, "12.189 mm"), (0.0, "0.0 µm")],
)
def test_a_deflection_is_in_mm_from_1_mm_on(size: float, text: str) -> None:
    assert length_text(size) == text


def test_round_off_of_a_force_is_zero() -> None:
    assert vector_text([1.83697e-14, -300.0, -0.0]) == "(0, -300, 0)" and vector_text([]) == "()"


@pytest.mark.parametrize("u", [0.0012, 0.019, 0.0196, 0.3, 1.94, 1.96, 7.0, 56.0, 140.0])
@pytest.mark.parametrize("value", [0.30071, -2.0, 1234.5678, 0.0])
def test_a_value_is_written_as_far_as_its_uncertainty_reaches(value: float, u: float) -> None:
    """Rounding adds at most a quarter of the uncertainty, and the next digit fewer would add more than a twentieth."""
    written, uncertain = with_uncertainty(value, u).split(" ± ")
    assert abs(float(written) - value) <= 0.5001 * u and abs(float(uncertain) - u) <= 0.26 * u
    decimals = [len(t.partition(".")[2]) for t in (written, uncertain)]
    assert decimals[0] == decimals[1]
    step = 10.0 ** -decimals[0] if decimals[0] else 10.0 ** (len(uncertain) - len(uncertain.rstrip("0")))
    assert 0.05 * u < step < 1.01 * u


@pytest.mark.parametrize(("value", "u"), [(-1e-9, 0.01), (-0.0, 0.0), (-0.04, 3.0), (-4.0, 90.0)])
def test_no_zero_has_a_sign(value: float, u: float) -> None:
    assert with_uncertainty(value, u).split(" ± ")[0].strip("0.") == ""

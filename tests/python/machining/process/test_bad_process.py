"""Process files that cannot be used: one message each, with file, line and key."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import pytest
from tests.python.machining.process.closed_form import END_MILL, process

import stiffmap as sm
from stiffmap.common.errors import FileError


def changed(**given: Any) -> dict[str, Any]:
    return {**process("climb", "5 mm"), **given}


TOOL = {"diameter": "25 mm", "teeth": 2}
KIENZLE = {"kc11": "1800 N/mm2", "mc": 0.2, "radial": 0.4}
BAD = [
    ({"tool": {**TOOL, "diameter": 25}}, "unit is missing"),
    ({"tool": {**TOOL, "diameter": "25 m"}}, "at most 1000 mm"),
    ({"tool": {**TOOL, "diameter": "-25 mm"}}, "above zero"),
    ({"tool": {**TOOL, "teeth": 0}}, "1 to 1000 teeth"),
    ({"tool": {**TOOL, "teeth": 2.5}}, "teeth"),
    ({"tool": {**TOOL, "teeth": "coated"}}, "feed per tooth"),
    ({"tool": {**TOOL, "helix": "89 deg"}}, "helix"),
    ({"tool": {**TOOL, "runout": {"offset": "20 mm"}}}, "quarter"),
    ({"tool": {**TOOL, "flutes": 2}}, "unknown key 'flutes'"),
    ({"spindle": "6000"}, "such as 6000 rpm"),
    ({"spindle": "6000 m"}, "such as 6000 rpm"),
    ({"spindle": "0 rpm"}, "above zero"),
    *(({"spindle": fast}, "up to 1e6 rpm") for fast in ("6000000 rpm", "6000 krpm", "20 kHz")),
    ({"feed": "0 mm/min"}, "above zero"),
    ({"feed": "0.075"}, "unit is missing"),
    ({"feed": "1 km/min"}, "unknown unit"),
    ({"feed": "900 m/min"}, "chip is too thick"),
    ({"cut": {"side": "climb", "axial": "3 mm"}}, "missing key 'radial'"),
    ({"cut": {"side": "up", "radial": "1 mm", "axial": "3 mm"}}, "conventional"),
    ({"cut": {"side": "slot", "radial": "1 mm", "axial": "3 mm"}}, "as wide as the tool"),
    ({"cut": {"side": "climb", "radial": "26 mm", "axial": "3 mm"}}, "at most the tool's diameter"),
    ({"law": {}}, "expected one of end_mill, kienzle, trimming, found none"),
    ({"law": {"end_mill": {k: v for k, v in END_MILL.items() if k != "Kre"}}}, "missing key 'Kre'"),
    ({"law": {"end_mill": {**END_MILL, "Ktc": "-5 N/mm2"}}}, "above zero"),
    ({"law": {"end_mill": {**END_MILL, "Ktc": "800 N/m2"}}}, "expected 0.1 to 100000 N/mm2 (J/cm3), found '800 N/m2'"),
    ({"law": {"end_mill": {**END_MILL, "Ktc": "800 GPa"}}}, "found '800 GPa'"),
    ({"tolerance": "50 mm"}, "at most 25 mm, found '50 mm'"),
    ({"law": {"end_mill": {**END_MILL, "Ktc": {"value": "5 N/mm2", "u": "-1 N/mm2"}}}}, "zero or more"),
    ({"law": {"end_mill": {**END_MILL, "Ktc": [1]}}}, "number with its unit"),
    ({"law": {"trimming": {"specific_energy": "1 J/mm3", "radial": 0.5}}}, "without a number of teeth"),
    ({"law": {"kienzle": {"kc11": "1800 N/mm2", "mc": 1.2, "radial": 0.4}}}, "exponent from 0"),
    ({"tolerance": "0 mm"}, "above zero"),
    ({"law": {"kienzle": {**KIENZLE, "radial": 30}}}, "law.kienzle.radial: expected at most 10 (0.3 for 30 %); found 30"),
    ({"law": {"kienzle": {**KIENZLE, "axial": -20}}}, "law.kienzle.axial: expected at most 10 (0.3 for 30 %); found -20"),
    ({"law": {"kienzle": {**KIENZLE, "radial": {"value": 0.3, "u": 30}}}}, "at most 10 (0.3 for 30 %); found 30"),
    ({"tool": {**TOOL, "teeth": "coated"}, "feed": "6 m/min", "law": {"trimming": {"specific_energy": "1 J/mm3", "radial": 60}}},
        "law.trimming.radial: expected at most 10"),
    ({"law": {"end_mill": {**END_MILL, "Krc": "251 kN/mm2"}}}, "at most 10 times Ktc; found '251 kN/mm2'"),
    ({"law": {"end_mill": {**END_MILL, "Kte": "15750 N/mm"}}}, "at most 1 mm times Ktc; found '15750 N/mm'"),
    ({"feed": "0.075 mm/min"}, "chip is too thin"),
    ({"feed": "0.075 um/rev"}, "chip is too thin"),
    ({"tool": {**TOOL, "teeth": 3}, "feed": "1350 mm/tooth"}, "chip is too thick"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("key", "texts", "si"),
    [
        ("modulus", ["580000 MPa", "580 GPa", "580e3 N/mm²", "580e9 Pa"], 580e9),
        ("feed", ["1200 mm/min", "0.1 mm/tooth", "0.2 mm/rev", "200 um/rev"], 0.02),
        ("spindle", ["6000 rpm", "6000 RPM", "6000 1/min", "628.3185307 rad/s", "100 Hz"], 628.3185307),
    ],
)  # fmt: skip
def test_units_of_the_workshop(key: str, texts: list[str], si: float) -> None:
    for text in texts:
        given = {"feed": "1200 mm/min", key: text}
        if key == "modulus":
            given = {"tool": {**TOOL, key: text}}
        p = sm.load_process(changed(**given))
        assert getattr(p.tool if key == "modulus" else p, key) == pytest.approx(si, rel=1e-9)


def test_no_message_invites_units_that_no_workshop_writes() -> None:
    for key, value, units in (
        ("feed", "900", "mm/min"),
        ("law", {"end_mill": {**END_MILL, "Ktc": 900}}, "N/mm2"),
    ):
        with pytest.raises(FileError, match=f"write 900{units}"):
            sm.load_process(changed(**{key: value}))


def test_a_modulus_is_written_as_it_is_read(tmp_path: Path) -> None:
    base = sm.load_process(changed(tool={**TOOL, "modulus": "580 GPa"}))
    table = {"feed_per_tooth_mm": [0.05, 0.1, 0.15], "Fx_N": [60, 77, 95], "Fy_N": [107, 171, 240], "Fz_N": [71, 85, 99], "teeth": 2,
        "axial_mm": 3, "side": "slot"}  # fmt: skip
    file = sm.identify_process(table).save(tmp_path / "p.yaml", base)
    assert sm.load_process(file).tool.modulus == pytest.approx(580e9)


@pytest.mark.parametrize(("given", "message"), BAD, ids=[m for _, m in BAD])
def test_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(FileError) as caught:
        sm.load_process(changed(**given))
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_file_and_line_are_named(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(
        "name: p\ntool: {diameter: 10 mm, teeth: 2}\nspindle: 6000 rpm\nfeed: 0\n"
        "cut: {side: slot, axial: 1 mm}\nlaw: {kienzle: {kc11: 1800 N/mm2, mc: 0.2, radial: 0.3}}\n"
    )
    with pytest.raises(FileError, match=r"p\.yaml, line 4: feed:"):
        sm.load_process(path)


def test_unknown_name() -> None:
    with pytest.raises(FileError, match=r"did you mean 'trimming'.*slot, trimming"):
        sm.load_process("triming")


@pytest.mark.parametrize("feed", ["1e999999999 mm/min", "0." + "1" * 6000 + " mm/min", 10**400])
def test_endless_numbers(feed: object) -> None:
    with pytest.raises(FileError, match=r"feed: .*(endless|too large)"):
        sm.load_process(changed(feed=feed))


@pytest.mark.parametrize(
    "spindle", ["6 krpm", "6000 U/min", "6000 rpm", "6000 min-1", "0.1 kHz", "6000 r/min", "100Hz"]
)
@pytest.mark.parametrize(
    "feed", ["0.3 mm/U", "0.3 mm/rev", "0.15 mm/Zahn", "0.15 mm/tooth", "1800 mm/min", "1.8 m/min"]
)
def test_speeds_and_feeds_as_workshops_write_them(spindle: str, feed: str) -> None:
    p = sm.load_process(changed(spindle=spindle, feed=feed, tool=TOOL))
    assert p.spindle == pytest.approx(200 * pi, rel=1e-12)
    assert p.feed == pytest.approx(0.03, rel=1e-12)


@pytest.mark.parametrize("feed", ["72 ipm", "0.012 ipr", "0.006 ipt", "72ipm", "0.012 in/rev", "72 in/min"])
def test_feeds_in_inches(feed: str) -> None:
    assert sm.load_process(changed(spindle="6000 rpm", feed=feed, tool=TOOL)).feed == pytest.approx(0.03048)

"""Coefficients from forces: what went in comes out; the measured set of the documentation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.process.force import revolution
from stiffmap.machining.process.identify.table import read_table

MEASURED = {
    "feed_per_tooth_mm": [0.025, 0.05, 0.075, 0.1, 0.125],
    "Fx_N": [39.8, 60.1, 71.6, 76.8, 78.5],
    "Fy_N": [63.0, 107.1, 137.7, 171.3, 210.7],
    "Fz_N": [55.7, 70.9, 82.6, 85.2, 83.5],
    "teeth": 2,
    "axial_mm": 3.0,
}


def test_measured_set() -> None:
    """Ordinary least squares by hand, from the slot's closed form: F = a + b c."""
    law = sm.identify_process(MEASURED)
    c = np.array(MEASURED["feed_per_tooth_mm"])
    for n, column, per_chip, per_edge in (
        ("t", "Fy_N", 2 * 3 / 4, 2 * 3 / np.pi),
        ("r", "Fx_N", 2 * 3 / 4, 2 * 3 / np.pi),
        ("a", "Fz_N", 2 * 3 / np.pi, 2 * 3 / 2),
    ):
        b, a = np.polyfit(c, np.array(MEASURED[column]), 1)
        left = np.array(MEASURED[column]) - a - b * c
        u = np.sqrt((left**2).sum() / 3 / ((c - c.mean()) ** 2).sum())
        value, error = law.coefficients[f"K{n}c"]
        assert value == pytest.approx(1e6 * b / per_chip, rel=1e-9)
        assert error == pytest.approx(1e6 * u / per_chip, rel=1e-6)
        assert law.coefficients[f"K{n}e"][0] == pytest.approx(1e3 * a / per_edge, rel=1e-9)
    assert law.rms == pytest.approx([5.3, 2.9, 5.2], abs=0.05)
    assert np.abs(law.left_out).max(axis=0) == pytest.approx([17, 8, 15], abs=0.5)
    assert law.bent
    assert law.best.model.name == "Kienzle"
    assert any("bend" in w for w in law.words())
    at = law.process(sm.load_process("slot"))
    assert "secant" in at.note
    assert sm.cutting_force(at).mean == pytest.approx(law.best.predict(at))


def test_other_names_of_columns() -> None:
    names = {
        "feed_per_tooth_mm": "feed per tooth [mm]",
        "Fx_N": "fx [N]",
        "Fy_N": "FY_N",
        "teeth": "n_teeth",
        "axial_mm": "ap [mm]",
    }
    law = sm.identify_process({names.get(k, k): v for k, v in MEASURED.items()})
    assert law.coefficients == sm.identify_process(MEASURED).coefficients


def made(noise: float = 0.0, signals: bool = False, runout: float = 0.0) -> dict[str, Any]:
    """Readings of the shipped slot at four feeds."""
    rng = np.random.default_rng(3)
    rows = []
    p = sm.load_process("slot")
    for chip in (0.05, 0.075, 0.1, 0.125):
        cut = replace(p, feed=chip * 1e-3 * 2 * 100, tool=replace(p.tool, runout=runout))
        _, force = revolution(cut, 200, 30)
        if not signals:
            rows.append((chip, 0.0, *sm.cutting_force(cut).mean))
            continue
        rows += [(chip, (t + k) / 200 / 100, *f) for k in (0, 200) for t, f in enumerate(force)]
    columns = np.array(rows).T
    out = dict(zip(("feed_per_tooth_mm", "time_s", "Fx_N", "Fy_N", "Fz_N"), columns, strict=True))
    for n in ("Fx_N", "Fy_N", "Fz_N"):
        out[n] = out[n] + rng.normal(0, noise, len(out[n])) if noise else out[n]
    if not signals:
        del out["time_s"]
    return {**out, "teeth": 2, "axial_mm": 3.0, "spindle_rpm": 6000, "diameter_mm": 25, "helix_deg": 30}


def test_means_of_forces_and_words_name_columns(tmp_path: Path) -> None:
    head = "feed [mm/tooth];Fx mean [N];Fy_avg [N];Fz average [N];Zähne;axial depth of cut [mm]"
    (tmp_path / "f.csv").write_text(f"{head}\n0,05;-50;100;30;2;1\n0,1;-90;180;50;2;1\n", encoding="utf-8")
    found = read_table(tmp_path / "f.csv")
    np.testing.assert_allclose(found.force, [[-50, 100, 30], [-90, 180, 50]])
    np.testing.assert_allclose([p.cut.axial for p in found.cuts], 1e-3)


def test_letters_of_data_sheets_name_columns() -> None:
    table = {k: v for k, v in MEASURED.items() if k not in ("feed_per_tooth_mm", "teeth")}
    feed = [c * 2 * 3000 for c in MEASURED["feed_per_tooth_mm"]]
    same = sm.identify_process(MEASURED).coefficients
    for speed in ("n [rpm]", "spindle_speed_rpm", "Spindle speed [1/min]"):
        other = {**table, "vf [mm/min]": feed, speed: 3000, "flutes": 2, "D [mm]": 25}
        assert {k: v[0] for k, v in sm.identify_process(other).coefficients.items()} == pytest.approx(
            {k: v[0] for k, v in same.items()}
        )


@pytest.mark.parametrize(
    ("head", "size"),
    [
        ("feed [mm/rev]", 2), ("feed_mm_rev", 2), ("Vorschub [mm/U]", 2), ("f [mm/rev]", 2), ("feed [ipr]", 2 / 25.4),
        ("feed [mm/Zahn]", 1), ("feed [ipt]", 1 / 25.4), ("feed [ipm]", 6000 / 25.4), ("vf [in/min]", 6000 / 25.4),
    ],
)  # fmt: skip
def test_feeds_as_workshops_write_them(head: str, size: float) -> None:
    table = {k: v for k, v in MEASURED.items() if k != "feed_per_tooth_mm"}
    table |= {head: [c * size for c in MEASURED["feed_per_tooth_mm"]], "spindle [krpm]": 3.0, "teeth": 2}
    found, same = read_table(table), read_table({**MEASURED, "spindle_rpm": 3000, "teeth": 2})
    np.testing.assert_allclose([p.feed for p in found.cuts], [p.feed for p in same.cuts], rtol=1e-12)


def test_straight_forces_come_back() -> None:
    law = sm.identify_process(made(noise=0.5))
    assert not law.bent
    truth = sm.load_process("slot").law
    for n, (value, u) in law.coefficients.items():
        assert abs(value - getattr(truth, n)) < 4 * u, n


def test_runout_from_the_line_at_the_spindle() -> None:
    law = sm.identify_process(made(signals=True, runout=12e-6))
    assert law.runout is not None
    assert law.runout.offset == pytest.approx(12e-6, rel=0.03)
    assert law.process(sm.load_process("slot")).tool.runout == law.runout.offset


def test_the_interval_of_no_runout_by_hand() -> None:
    """A line that changes its sign from one revolution to the next is noise alone: its power A² s is taken off, and varies by itself.

    With A² = k s, s the power of the line per square of run-out, three feeds give -k ± 1.96 k / √3.
    """
    p, size, k = sm.load_process("slot"), 5e-6, (8e-6) ** 2
    table = made(signals=True)
    keep = np.asarray(table["feed_per_tooth_mm"]) > 0.06
    table = {n: v[keep] if isinstance(v, np.ndarray) else v for n, v in table.items()}
    angle = 2 * np.pi * np.arange(400) / 200
    for chip in (0.075, 0.1, 0.125):
        cut = replace(p, feed=chip * 1e-3 * 2 * 100, tool=replace(p.tool, runout=size))
        line = np.fft.rfft(revolution(cut, 200, 30)[1][:, :2], axis=0)[1] * 2 / 200
        power = (np.abs(line) ** 2).sum() / size**2
        rows = np.asarray(table["feed_per_tooth_mm"]) == chip
        table["Fx_N"][rows] += np.sqrt(k * power) * np.cos(angle) * np.repeat([1, -1], 200)
    found = sm.identify_process(table).runout
    assert found is not None and found.offset < 0.2e-6
    assert found.interval == pytest.approx((0.0, np.sqrt(k * (1.96 / np.sqrt(3) - 1))), rel=0.06)


def test_side_cuts_and_a_file(tmp_path: Path) -> None:
    p = sm.load_process("slot")
    lines = ["feed_per_tooth_mm,Fx_N,Fy_N,Fz_N,teeth,axial_mm,side,radial_mm,diameter_mm"]
    for chip in (0.05, 0.1, 0.15):
        cut = replace(p, feed=chip * 1e-3 * 200, cut=replace(p.cut, side="climb", radial=8e-3))
        f = sm.cutting_force(cut).mean
        lines.append(f"{chip},{f[0]!r},{f[1]!r},{f[2]!r},2,3,climb,8,25")
    path = tmp_path / "forces.csv"
    path.write_text("\n".join(lines).replace("np.float64(", "").replace(")", ""))
    law = sm.identify_process(path)
    for n, (value, _) in law.coefficients.items():
        assert value == pytest.approx(getattr(p.law, n), rel=1e-6)


def test_a_data_frame_is_a_table() -> None:
    columns = {"feed_per_tooth_mm": [0.05, 0.1, 0.2], "Fx_N": [-40, -60, -101.0], "Fy_N": [60, 100, 181.0],
               "Fz_N": [5, 8, 14.5], "teeth": 2, "axial_mm": 3}  # fmt: skip
    frame = pd.DataFrame(columns, index=[7, 5, 6])
    law = sm.identify_process(frame)
    assert law.coefficients == sm.identify_process(columns).coefficients
    with pytest.raises(StiffmapError, match=r"Fy_N'?: .*finite.*nan"):
        sm.identify_process(frame.replace(100.0, np.nan))
    with pytest.raises(StiffmapError, match="a mapping or a DataFrame, got list"):
        sm.identify_process([1, 2])


@pytest.mark.parametrize("side", ["climb", "conventional"])
def test_forces_on_the_part_are_no_forces_on_the_tool(side: str) -> None:
    """Of a slot the signs are known; of another cut only that the tangential pressure is above zero."""
    p, chip = sm.load_process("slot"), np.array([0.05, 0.1, 0.15])
    cut = replace(p.cut, side=side, radial=8e-3)
    force = np.array([sm.cutting_force(replace(p, feed=0.2 * c, cut=cut)).mean for c in chip])
    table = {
        "feed_per_tooth_mm": chip,
        "teeth": 2,
        "axial_mm": 3,
        "side": side,
        "radial_mm": 8,
        "diameter_mm": 25,
    }
    on_tool, on_part = (table | {f"F{a}_N": s * force[:, i] for i, a in enumerate("xyz")} for s in (1, -1))
    good, bad = sm.identify_process(on_tool), sm.identify_process(on_part)
    assert good.coefficients["Ktc"][0] == pytest.approx(958.8e6, rel=1e-6)
    assert not any("below zero" in w for w in good.words())
    assert any("Ktc is below zero" in w and "on the part" in w for w in bad.words())
    turned = on_tool | {"Fx_N": -force[:, 0]}
    other = on_tool | {"side": "conventional" if side == "climb" else "climb"}
    for table, rare in ((on_tool, False), (turned, True), (other, True)):
        words = sm.identify_process(table).words()
        assert any("is the side right" in w or "below zero" in w for w in words) == rare


@pytest.mark.parametrize(
    "given", [{"radial_mm": 8, "diameter_mm": 25}, {"ae [mm]": 8}]
)  # fmt: skip
@pytest.mark.parametrize("base", [None, "slot"])
def test_a_width_that_is_not_the_tool_s_is_no_slot(given: dict[str, Any], base: str | None) -> None:
    with pytest.raises(
        StiffmapError, match=r"expected a column side \(climb, .* next to a width, found 8 mm"
    ):
        sm.identify_process({**MEASURED, **given}, base and sm.load_process(base))
    whole = {**MEASURED, "radial_mm": 25, "diameter_mm": 25}
    assert sm.identify_process(whole).coefficients == sm.identify_process(MEASURED).coefficients


BAD = [
    ({"teeth": None}, "missing column 'teeth'"),
    ({"Fq_N": 1}, "unknown column 'Fq_N'"),
    ({"feed_per_tooth_mm": [0.05, 0.05, 0.05, 0.1, 0.1]}, "3 or more feeds"),
    ({"Fx_N": [1, 2, 3, 4, "x"]}, "Fx_N': expected"),
    ({"Fx_N": [1, 2, 3]}, "Fx_N: expected"),
    ({"Fx_N": [1, 2, 3, 4, float("nan")]}, "finite"),
    ({"axial_mm": 0}, "axial_mm: expected a number above zero"),
    ({"side": "climb"}, "radial_mm"),
    ({"side": "across"}, "expected one of climb"),
    ({"teeth": 2.5}, "whole number"),
    ({"time_s": [1, 2, 3, 4, 5]}, "spindle_rpm"),
    *((dict.fromkeys(("Fx_N", "Fy_N", "Fz_N"), 0.0) | more, "expected forces, found 0 N in every row") for more in ({}, {"diameter_mm": 25})),
    ({"feed_mm_rev": 0.1}, "expected one feed, found 'feed_per_tooth_mm' and 'feed_mm_rev'"),
    ({"spindle_rpm": 6e6}, "spindle_rpm: expected at most 1e6 rpm, found 6000000"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "message"), BAD, ids=[m for _, m in BAD])
def test_refused(given: dict[str, Any], message: str) -> None:
    table = {k: v for k, v in {**MEASURED, **given}.items() if v is not None}
    with pytest.raises(StiffmapError) as caught:
        sm.identify_process(table)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("slower", "every", "rpm"),
    [(1000, 1, 6000), (1, 40, 6000), (1, 1, 360000)],
    ids=["ms as s", "logged", "per minute"],
)
def test_signals_that_miss_the_teeth_are_refused(slower: int, every: int, rpm: int) -> None:
    given = made(signals=True)
    given |= {n: given[n][::every] for n in ("feed_per_tooth_mm", "time_s", "Fx_N", "Fy_N", "Fz_N")}
    given |= {"time_s": slower * given["time_s"], "spindle_rpm": rpm}
    with pytest.raises(StiffmapError, match="with eight or more samples in each, found"):
        read_table(given)


def forces_of(given: dict[str, Any]) -> np.ndarray:
    return np.stack([given[n] for n in ("Fx_N", "Fy_N", "Fz_N")], axis=1)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (3.2, -1.7, 40.0), (-300.0, 200.0, 900.0)])
@pytest.mark.parametrize("idle", [slice(0, 200), slice(600, 800), slice(1350, 1600)])
@pytest.mark.parametrize("ripple", [1.0, 0.0], ids=["two teeth", "many teeth"])
def test_a_signal_with_a_part_without_a_cut_is_refused(
    offset: tuple[float, ...], idle: slice, ripple: float
) -> None:
    given = made(signals=True)
    force = np.array([60.0, 100.0, 30.0]) + ripple * forces_of(given)
    force[idle] = 0.0
    force += offset + np.random.default_rng(5).normal(0.0, 1.0, force.shape)
    with pytest.raises(StiffmapError, match="leave out the rows without a cut, and take their mean"):
        read_table(given | dict(zip(("Fx_N", "Fy_N", "Fz_N"), force.T, strict=True)))


@pytest.mark.parametrize("noise", [0.0, 1.0, 30.0, 300.0])
@pytest.mark.parametrize("every", [1, 7, 20])
def test_a_steady_signal_is_read_under_noise(noise: float, every: int) -> None:
    given = made(noise, signals=True, runout=10e-6)
    given |= {n: v[::every] for n, v in given.items() if np.ndim(v)}
    assert len(read_table(given).signals) == 4


@pytest.mark.parametrize("lost", [slice(150, 160), slice(100, 300), slice(10, 390)])
def test_a_signal_with_a_gap_is_refused(lost: slice) -> None:
    given = made(signals=True)
    given |= {n: np.delete(v, lost) for n, v in given.items() if np.ndim(v)}
    with pytest.raises(StiffmapError, match="in even steps, found"):
        read_table(given)


@pytest.mark.parametrize("unit", ["mrpm", "1/s", "x1000"])
def test_a_unit_next_to_rpm_counts(unit: str, tmp_path: Path) -> None:
    def text(head: str) -> str:
        rows = "".join(f"{c},10,20,30,2,3,6000\n" for c in (0.05, 0.1, 0.15))
        return f"feed_per_tooth_mm,Fx_N,Fy_N,Fz_N,teeth,axial_mm,{head}\n{rows}"

    (tmp_path / "f.csv").write_text(text(f"rpm [{unit}]"))
    with pytest.raises(StiffmapError, match="expected a unit such as in spindle_rpm, found"):
        read_table(tmp_path / "f.csv")
    for head in ("rpm", "rpm [rpm]", "rpm [1/min]"):
        (tmp_path / "f.csv").write_text(text(head))
        assert read_table(tmp_path / "f.csv").cuts[0].spindle == pytest.approx(200 * np.pi)


@pytest.mark.parametrize(
    "units",
    ["s N N N mm mm", "[s] [N] [N] [N] [mm] [mm]", "min N kN N mm mm", "ms N N N mm mm", "µs N N N mm mm"],
)
def test_times_have_a_unit_in_a_line_of_units(units: str, tmp_path: Path) -> None:
    size = {"min": 60.0, "ms": 1e-3, "µs": 1e-6}.get(units.split()[0], 1.0)
    force = 1e3 if "kN" in units else 1.0
    lines = [
        "Time Fx Fy Fz feed_per_tooth axial teeth spindle_rpm".replace(" ", "\t"),
        units.replace(" ", "\t"),
    ]
    lines += [f"{0.001 * k / size:.9g}\t10\t20\t30\t0.05\t3\t2\t6000" for k in range(21)]
    (tmp_path / "record.txt").write_text(
        "Date:\t01.02.2026\nSampling rate [Hz]:\t1000\n" + "\n".join(lines), encoding="utf-8"
    )
    table_ = read_table(tmp_path / "record.txt")
    np.testing.assert_allclose(np.abs(table_.force), [[10, 20 * force, 30]])
    np.testing.assert_allclose(table_.signals[0].time[-1], 0.02, atol=0.0011)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: f, ""),
        (lambda f: 1e-3 * f, "Ktc is not within"),  # kN below Fx_N
        (lambda f: 1e3 * f, "Ktc is not within"),
        (lambda f: f / 9.81e3, "Ktc is not within"),  # t
        (lambda f: f[:, [0, 2, 1]], "Fx, Fy and Fz"),
        (lambda f: f + [0.0, -60.0, 0.0], "An edge coefficient is below zero"),
        (lambda f: f + [110.0, 0.0, 0.0], "An edge coefficient is below zero"),
        (lambda f: f + [0.0, 0.0, 1900.0], "too large for an edge"),
    ],
)
def test_coefficients_that_no_material_has_are_doubted(change, words):
    """A slot in steel with four teeth, 2 mm deep, by the closed forms of its mean forces."""
    n, a, c = 4, 2e-3, np.array([20e-6, 40e-6, 60e-6, 80e-6, 100e-6])[:, None]
    chip, edge = [-600e6 / 4, 2000e6 / 4, 300e6 / np.pi], [-30e3 / np.pi, 20e3 / np.pi, 5e3 / 2]
    force = n * a * (c * chip + edge) + np.random.default_rng(1).normal(0, 0.3, (5, 3))
    table = {"feed_per_tooth_mm": 1e3 * c[:, 0], "teeth": n, "axial_mm": 2.0}
    columns = dict(zip(("Fx_N", "Fy_N", "Fz_N"), change(force).T, strict=True))
    notes = sm.identify_process(table | columns).table.notes
    assert words in " ".join(notes)
    assert bool(notes) == bool(words)

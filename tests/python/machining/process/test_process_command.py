"""``stiffmap process``: tables as workshops write them, intervals, rivals on feeds left out, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench.force_laws import FEEDS, MILL, coverage, mean, noisy, runout_coverage, table
from tests.python.project.docs.reader_files import FORCES, force_signals

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.machining.process.identify.models import KIENZLE
from stiffmap.ui.cli import main

ROWS = [line.split(",") for line in FORCES.splitlines()]
NOISY = np.random.default_rng(4)


@pytest.fixture
def forces(tmp_path: Path) -> Path:
    """The measured means of the documentation."""
    path = tmp_path / "forces.csv"
    path.write_text(FORCES, encoding="utf-8")
    return path


def run(*arguments: object) -> int:
    return main(["process", *map(str, arguments)])


@cache
def measured_coefficients() -> dict[str, tuple[float, ...]]:
    """Of the measured means, by the shipped slot."""
    columns = {n: [float(r[i]) for r in ROWS[1:]] for i, n in enumerate(ROWS[0])}
    return dict(sm.identify_process(columns, sm.load_process("slot")).coefficients)


def law_of(kind: str, side: str, noise: float) -> sm.IdentifiedLaw:
    (one,) = noisy(kind, side, list(FEEDS * 2), noise, 1, 7)
    return sm.identify_process(one)


# --- intervals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "side", "cuts", "noise", "count"),
    [
        ("straight", "slot", FEEDS, 0.02, 250), ("straight", "slot", FEEDS * 2, 0.3, 250),
        ("straight", "climb", FEEDS, 0.3, 250), ("straight", "conventional", FEEDS * 2, 0.02, 250),
        ("Kienzle", "slot", FEEDS, 0.15, 30), ("Kienzle", "climb", FEEDS, 0.02, 30),
    ],
)  # fmt: skip
def test_intervals_hold_the_truth_as_often_as_they_say(
    law: str, side: str, cuts: Any, noise: float, count: int
) -> None:
    """bench/force_laws.py has the campaign; where few tables fit here the bounds are three standard deviations wider."""
    share, many = coverage(law, noisy(law, side, list(cuts), noise, count, 5))
    few = 3 * np.sqrt(2 * 0.95 * 0.05 / many) if many < 1000 else 0.0
    assert share == pytest.approx(0.95, abs=0.02 + few)


def test_run_out_is_held_by_its_interval_and_zero_by_that_of_a_true_tool() -> None:
    assert runout_coverage(0.012, 40.0, 1, 1) == 1
    assert runout_coverage(0.0, 40.0, 1, 1) == 1


def test_heavier_noise_gives_wider_intervals() -> None:
    width = [np.diff(law_of("straight", "slot", noise).interval["Ktc"])[0] for noise in (0.01, 0.1, 0.3)]
    assert width[0] < width[1] < width[2]
    assert width[2] == pytest.approx(30 * width[0], rel=1e-6)


@pytest.mark.parametrize("side", ["slot", "climb", "conventional"])
def test_kienzle_means_come_back(side: str) -> None:
    """Forces by a sum over angles that shares no code."""
    clean = np.array([mean("Kienzle", side, c) for c in FEEDS])
    law = sm.identify_process(table(clean, list(FEEDS), side))
    assert law.best.model.name == "Kienzle"
    found = law.best.numbers
    assert [found[n][0] for n in ("Kt", "Kr", "Ka")] == pytest.approx([624e6, 108.6e6, 58e6], rel=1e-3)
    assert [found[n][0] for n in ("mt", "mr", "ma")] == pytest.approx([0.25, 0.45, 0.5], abs=1e-3)


def test_a_secant_carries_the_uncertainty_of_its_law_not_of_another() -> None:
    """Spread of the secant over many tables, against what each says of it."""
    base, stated, values = sm.load_process("slot"), [], []
    for t in noisy("Kienzle", "slot", list(FEEDS), 0.02, 40, 3):
        from stiffmap.machining.process.identify.models import fit
        from stiffmap.machining.process.identify.table import read_table

        value, u, *_ = fit(KIENZLE, read_table(t)).end_mill(base)["Ktc"]
        values.append(value)
        stated.append(u)
    assert np.sqrt(np.mean(np.square(stated))) == pytest.approx(np.std(values, ddof=1), rel=0.35)
    law = sm.identify_process(
        table(np.array([mean("Kienzle", "slot", c) for c in FEEDS]), list(FEEDS), "slot")
    )
    assert set(law.process(base).uncertainty) <= {"Ktc", "Krc", "Kac"}  # no edge, no uncertainty of one


# --- rivals ----------------------------------------------------------------------------------------------------------


def test_left_out_feeds_are_predicted_by_the_others_alone() -> None:
    law = sm.identify_process({n: [float(r[i]) for r in ROWS[1:]] for i, n in enumerate(ROWS[0])})
    c, y = (np.array([float(r[i]) for r in ROWS[1:]]) for i in (0, 2))
    by_hand = [y[i] - np.polyval(np.polyfit(np.delete(c, i), np.delete(y, i), 1), c[i]) for i in range(5)]
    assert law.left_out[:, 1] == pytest.approx(by_hand)
    assert [e.model.name for e in law.explanations] == ["Kienzle", "straight"]
    assert law.used.model.name == "Kienzle"


@pytest.mark.parametrize("kind", ["straight", "Kienzle"])
@pytest.mark.parametrize("side", ["slot", "climb"])
def test_good_readings_name_the_law_and_noise_does_not(kind: str, side: str) -> None:
    assert [e.model.name for e in law_of(kind, side, 0.005).alike] == [kind]
    lost = law_of(kind, side, 0.5)
    assert {e.model.name for e in lost.alike} == {"straight", "Kienzle"}
    assert "cannot be distinguished" in " ".join(lost.verdict())
    assert lost.used.model.name == "straight"


def test_three_feeds_have_no_rivals() -> None:
    clean = np.array([mean("straight", "slot", c) for c in FEEDS[:3]])
    assert "four feeds" in " ".join(sm.identify_process(table(clean, list(FEEDS[:3]), "slot")).words())


# --- tables ----------------------------------------------------------------------------------------------------------


def rewritten(header: dict[str, str], change: Callable[[str, float], float], separator: str = ",") -> str:
    """The measured table with other names and numbers."""
    names = [header.get(n, n) for n in ROWS[0]]
    body = [[f"{change(n, float(v)):.12g}" for n, v in zip(ROWS[0], r, strict=True)] for r in ROWS[1:]]
    return "\n".join(separator.join(r) for r in [names, *body]) + "\n"


def scaled(column: str, factor: float) -> Callable[[str, float], float]:
    return lambda n, v: v * factor if n == column else v


@pytest.mark.parametrize(
    "text",
    [
        rewritten({}, lambda n, v: v, ";"),
        rewritten({}, lambda n, v: v, "\t"),
        "# a remark\n\n" + FORCES,
        "\ufeff" + FORCES,
        rewritten({"Fx_N": "Fx [kN]"}, scaled("Fx_N", 1e-3)),
        rewritten({"Fy_N": "fy (N)", "teeth": "z", "axial_mm": "ap [mm]"}, lambda n, v: v),
        rewritten({"feed_per_tooth_mm": "fz [um/tooth]"}, scaled("feed_per_tooth_mm", 1e3)),
        rewritten({"feed_per_tooth_mm": "feed [mm/tooth]"}, lambda n, v: v),
        rewritten({"feed_per_tooth_mm": "feed [m/min]"}, scaled("feed_per_tooth_mm", 12.0)),
        rewritten({"feed_per_tooth_mm": "feed_mm_min"}, scaled("feed_per_tooth_mm", 12e3)),
    ],
)
def test_one_table_written_in_many_ways(text: str, tmp_path: Path) -> None:
    base = sm.load_process("slot")
    (tmp_path / "other.csv").write_text(text, encoding="utf-8")
    found = sm.identify_process(tmp_path / "other.csv", base).coefficients
    for n, v in measured_coefficients().items():
        assert found[n] == pytest.approx(v, rel=1e-9)


def cuts(line: str, side: str = "slot") -> str:
    """A line for each feed: c the feed per tooth in mm, x, y, z the means in N."""
    each = ((c, *mean("straight", side, c)) for c in FEEDS)
    return "".join(line.format(c=c, v=c * 2 * 6000, x=x, y=y, z=z) + "\n" for c, x, y, z in each)


MEANS = "Feed per tooth (mm),Fx (N),Fy (N),Fz (N)\n" + cuts("{c},{x},{y},{z}")
ABOVE = "Workpiece: Al 7075\nTool: end mill, D = 25 mm, z = 2\nap = 3 mm, slotting\n\n"
CELLS = "Tool diameter,25,mm\nNumber of teeth,2,\nAxial depth of cut,3,mm\nSpindle speed,6000,rpm\n,,\n"
TABLES = {
    "titles": ABOVE + MEANS,
    "titles of cells": CELLS + "vf [mm/min],Fx [N],Fy [N],Fz [N]\n" + cuts("{v},{x},{y},{z}"),
    "a title for each feed": "".join(
        f"Feed per tooth: {c} mm\nFx [N],Fy [N],Fz [N],teeth,ap [mm]\n{x},{y},{z},2,3\n\n"
        for c, (x, y, z) in ((c, mean("straight", "slot", c)) for c in FEEDS)
    ),
    "counted": "4 mm holder\nEnd mill D25, 2 teeth, ap: 3 mm, 5 passes\n" + MEANS,
    "a decimal comma": (ABOVE + MEANS).replace(",", ";").replace(".", ","),
    "words": "Test No.,Feed per tooth (mm),Mean force X (N),Fy avg (N),Axial force (N),Number of teeth,Depth of cut (mm)\n"
    + cuts("T{c},{c},{x},{y},{z},2,3"),
    "units below": "Feed per tooth,Fx,Fy,Fz,Flutes,Axial depth\nmm,N,N,N,-,mm\n" + cuts("{c},{x},{y},{z},2,3"),
    "climb": "Zahnvorschub [mm];Fx [N];Fy [N];Fz [N];Zähnezahl;Schnitttiefe [mm];Eingriffsbreite [mm];Fräserdurchmesser [mm];Art\n"
    + cuts("{c};{x};{y};{z};2;3;8;25;Gleichlauf", "climb"),
    "up milling": "fz [mm],Fx [N],Fy [N],Fz [N],z,ap [mm],ae [mm],D [mm],Milling mode\n"
    + cuts("{c},{x},{y},{z},2,3,8,25,up milling", "conventional"),
    "names to the left": "\n".join(
        ",".join(row) for row in zip(*(line.split(",") for line in (
            "Feed per tooth (mm),Fx (N),Fy (N),Fz (N),Teeth,ap (mm)\n" + cuts("{c},{x},{y},{z},2,3")
        ).splitlines()), strict=True)
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*stands in the title")
@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_tables_as_laboratories_write_them(text: str, tmp_path: Path) -> None:
    (tmp_path / "cuts.csv").write_text(text, encoding="utf-8")
    found = sm.identify_process(tmp_path / "cuts.csv").coefficients
    for n, truth in MILL.items():
        assert found[n][0] == pytest.approx(truth * (1e3 if n[-1] == "e" else 1e6), rel=1e-4)


def test_what_no_law_is_found_from_is_left_out_with_a_word(tmp_path: Path) -> None:
    path = tmp_path / "cuts.csv"
    head = "vc [m/min],ft [mm],Fx mean [N],Fx max [N],Fy [N],Fz [N],Mz [Nm],flutes,ap [mm]\n"
    path.write_text(head + cuts("188,{c},{x},9,{y},{z},1,2,3") + "Mean,1,1,1,1,1,1,,\n")
    with pytest.warns(
        UserWarning, match=r"row 7, 'Mean', is no reading, vc \[m/min\], Fx max \[N\], Mz \[Nm\]"
    ):
        assert sm.identify_process(path).coefficients["Ktc"][0] == pytest.approx(958.8e6, rel=1e-4)
    path.write_text(path.read_text().replace("Fx mean", "Fx min"))
    with pytest.warns(UserWarning, match="Fx min"), pytest.raises(FileError, match="missing column 'Fx_N'"):
        sm.identify_process(path)


@pytest.mark.parametrize(
    ("title", "message"),
    [
        ("Feed per tooth: 0.05 N", "missing column 'feed_per_tooth_mm'"),  # no length
        ("Feed per tooth: 0.05", "missing column 'feed_per_tooth_mm'"),
        ("Surface speed: 0.05 mm", "missing column 'feed_per_tooth_mm'"),
    ],
)
def test_titles_that_say_nothing_of_a_cut(title: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "cuts.csv").write_text(f"{title}\nFx [N],Fy [N],Fz [N],teeth,ap [mm]\n1,2,3,2,3\n1,2,4,2,3\n")
    with pytest.raises(FileError, match=message):
        sm.identify_process(tmp_path / "cuts.csv")


def test_a_workbook_is_the_same_table(tmp_path: Path, forces: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title = "notes"
    sheet = book.create_sheet("slots")
    sheet.append(ROWS[0])
    for row in ROWS[1:]:
        sheet.append([float(v) for v in row])
    book.save(tmp_path / "forces.xlsx")
    found = sm.identify_process(tmp_path / "forces.xlsx", sheet="slots")
    assert found.coefficients == sm.identify_process(forces).coefficients
    with pytest.raises(FileError, match=r"forces\.xlsx: no sheet 'sides'; there are: notes, slots"):
        sm.identify_process(tmp_path / "forces.xlsx", sheet="sides")


def test_signals_of_two_depths_at_one_feed_are_two_cuts() -> None:
    time = np.arange(40) / 4000
    columns: dict[str, list[float]] = {
        n: [] for n in ("feed_per_tooth_mm", "time_s", "axial_mm", "Fx_N", "Fy_N", "Fz_N")
    }
    for c in FEEDS[:3]:
        for depth in (1.5, 3.0):
            force = mean("straight", "slot", c) * depth / 3
            for t in time:
                for n, v in zip(columns, (c, t, depth, *force), strict=True):
                    columns[n].append(v)
    law = sm.identify_process({**columns, "teeth": 1, "spindle_rpm": 6000})
    assert len(law.table.cuts) == 6
    assert law.coefficients["Ktc"][0] == pytest.approx(2 * 958.8e6, rel=1e-6)  # half the teeth of `mean`


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_file_is_read_as_it_is(forces: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "process.yaml"
    assert run(forces, "--process", "slot", "-o", out) == 0
    said = capsys.readouterr().out
    assert "95 %" in said and "Kienzle" in said and str(out) in said
    written, law = sm.load_process(out), sm.identify_process(forces, sm.load_process("slot"))
    assert "forces.csv" in written.source and "95 % interval" in out.read_text(encoding="utf-8")
    assert sm.cutting_force(written).mean == pytest.approx(
        law.best.predict(sm.load_process("slot")), rel=1e-5
    )
    assert written.uncertainty["Ktc"] == pytest.approx(law.best.end_mill(written)["Ktc"][1], rel=0.01)
    lobes = ["lobes", "linear-delta", "--process", str(out), "--points", "2,2", "--method", "zero order"]
    assert main(lobes) in (0, 1)


@pytest.mark.parametrize("side", ["slot", "climb", "conventional"])
def test_a_table_with_tool_and_speed_needs_no_process(side: str, tmp_path: Path) -> None:
    clean = np.array([mean("straight", side, c) for c in FEEDS])
    columns = {**table(clean, list(FEEDS), side), "spindle_rpm": 6000, "helix_deg": 30}
    law = sm.identify_process(columns)
    p = sm.load_process(law.save(tmp_path / "p.yaml"))
    assert (p.cut.side, p.tool.teeth, p.tool.helix) == (side, 2, pytest.approx(np.radians(30)))
    assert p.chip == pytest.approx(0.075e-3)
    assert sm.cutting_force(p).mean == pytest.approx(clean[2], rel=1e-4)


def test_json_and_signals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "signals.csv").write_text(force_signals(), encoding="utf-8")
    assert run(tmp_path / "signals.csv", "--json", "-o", tmp_path / "p.yaml") == 0
    data = json.loads(capsys.readouterr().out)
    low, high = data["runout"]["interval"]
    assert low <= 12e-6 <= high and high - low < 8e-6
    assert {law["name"] for law in data["laws"]} == {"straight", "Kienzle", "run-out"}
    assert sm.load_process(tmp_path / "p.yaml").tool.runout == pytest.approx(
        data["runout"]["offset"], rel=1e-3
    )


def test_no_input_and_nothing_of_the_user_is_replaced(
    forces: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("a: 1\n", encoding="utf-8")
    assert run(forces, "--process", "slot", "-o", tmp_path / "own.yaml") == 0
    for base, out in (("slot", forces), ("slot", mine), (tmp_path / "own.yaml", tmp_path / "own.yaml")):
        before = out.read_bytes()
        assert run(forces, "--process", base, "-o", out) == 2
        assert out.read_bytes() == before
        assert "cannot be written" in capsys.readouterr().err
    assert run(forces, "--process", "slot", "-o", tmp_path / "own.yaml") == 0  # its own, again


def test_coefficients_of_no_process_are_not_written(tmp_path: Path) -> None:
    falling = {
        "feed_per_tooth_mm": [0.05, 0.1, 0.15],
        "Fx_N": [9, 8, 7],
        "Fy_N": [9, 8, 7],
        "Fz_N": [9, 8, 7],
    }
    law = sm.identify_process({**falling, "teeth": 2, "axial_mm": 3})
    with pytest.raises(FileError, match=r"p\.yaml: no process file can be written: .*Ktc.*above zero"):
        law.save(tmp_path / "p.yaml", sm.load_process("slot"))
    assert not (tmp_path / "p.yaml").exists()


def put(row: int, column: int, text: str) -> str:
    """The measured table with another cell."""
    rows = [list(r) for r in ROWS]
    rows[row][column] = text
    return "\n".join(",".join(r) for r in rows) + "\n"


BAD = [
    *((put(row, 1, t), rf"line {row + 1}: column 'Fx_N': expected a finite number; found '{t}'") for row, t in ((1, "nan"), (3, "inf"), (5, "NaN"))),
    *((put(2, 3, t), rf"line 3: column 'Fz_N': expected a number; found '{t}'") for t in ("x", "1_0", "70.9 N")),
    *((put(3, 0, t), rf"line 4: feed_per_tooth_mm: expected a number above zero, found {t}") for t in ("0", "-0.1", "-5")),
    *((put(4, k, "0"), rf"line 5: {n}: expected a number above zero, found 0") for k, n in ((4, "teeth"), (5, "axial_mm"))),
    *((put(1, 0, t), rf"line 2: feed_per_tooth_mm: .*found {t}; is it a feed per tooth") for t in ("300", "900", "1500")),
    ("\n".join(",".join(["0.05" if i else r[0], *r[1:]]) for i, r in enumerate(ROWS)), r"feed_per_tooth_mm: expected forces at 3 .*found 1"),
    ("\n".join(FORCES.splitlines()[:3]), r"3 or more feeds .*found 2"),
    ("\n".join(FORCES.splitlines()[:2]), r"3 or more feeds .*found 1"),
    (FORCES.splitlines()[0], r"no header line with rows of numbers below it"),
    ("", r"empty"),
    *((FORCES.replace("Fx_N", n), r"Fx.*expected a unit such as in Fx_N, found") for n in ("Fx", "Fx [lbx]", "Fx [mm]")),
    *((FORCES.replace("feed_per_tooth_mm", n), r"mm/tooth, mm/rev or mm/min") for n in ("feed", "feed [mm]", "feed_per_tooth [mm/min]")),
    (FORCES.replace("feed_per_tooth_mm", "feed [mm/min]"), r"missing column 'spindle_rpm'"),
    (FORCES.replace("teeth", "feed [mm/min]"), r"expected one feed, found 'feed_per_tooth_mm' and 'feed \[mm/min\]'"),
    (FORCES.replace("Fy_N", "fx [N]"), r"a column is given twice, as 'Fx_N' and 'fx \[N\]'"),
    (FORCES.replace("39.8,", ""), r"line 2: expected 6 values, found 5"),
    (FORCES.replace("Fx_N", "Fq_N"), r"unknown column 'Fq_N'"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD)
def test_refused(text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=rf"bad\.csv.*{message}"):
        sm.identify_process(path)
    assert run(path, "-o", tmp_path / "p.yaml") == 2
    said = capsys.readouterr()
    assert "bad.csv" in said.err and len(said.err.strip().splitlines()) <= 2 and not said.out
    assert not (tmp_path / "p.yaml").exists()

"""Twenty ugly sheets, read to their truth; what is wrong is said with sheet, row and column; nothing is left behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.units import unit_of
from stiffmap.ui.cli import main

from .ugly import LATER, STILL, TRUTH, UGLY, Ugly

CLEAN = "Nr;x [mm];y [mm];fx [N];dx [µm]\n1;0;400;100;12.5\n2;50;400;100;14.0\n"


@pytest.fixture(autouse=True)
def own_profiles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))


def imported(sheet: Ugly, folder: Path) -> tuple[int, sm.Experiment | None]:
    if not isinstance(sheet.text, str):
        pytest.importorskip("openpyxl")
    code = main(["experiment", "new", str(sheet.write(folder)), "--machine", "five-bar", *sheet.more,
                 "-o", str(folder / "e")])  # fmt: skip
    return code, sm.load_experiment(folder / "e") if code == 0 else None


def matches(e: sm.Experiment, sheet: Ugly) -> None:
    truth = np.array(sheet.truth)
    np.testing.assert_allclose(e.position[:, :2], 1e-3 * truth[:, :2], rtol=1e-9)
    np.testing.assert_allclose(e.wrench[:, 0], truth[:, 2], rtol=1e-9)
    np.testing.assert_allclose(e.reading[:, :2], 1e-6 * truth[:, 3:], rtol=1e-9)


@pytest.mark.parametrize("name", UGLY)
def test_twenty_ugly_sheets(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, e = imported(UGLY[name], tmp_path)
    assert code == 0, capsys.readouterr().err
    assert e is not None
    matches(e, UGLY[name])


@pytest.mark.parametrize("name", LATER)
def test_twenty_more(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, e = imported(LATER[name], tmp_path)
    out = capsys.readouterr()
    if name in STILL:
        assert code == 2 and sorted(p.name for p in tmp_path.iterdir()) in (["sheet.csv"], ["sheet.xlsx"])
        return
    assert e is not None, out.err
    matches(e, LATER[name])
    assert "'x [mm]' less" not in out.out


LAYERED = """Delta No. 7;;;;;;
Operator:;M. Weber;;Instrument:;3 dial gauges;;
;;;;;;
#;Position;;Force;;Gauge;Remark
;X;Y;Fx;Fy;x;
;mm;mm;kgf;kgf;1/100 mm;
P1;0;400;10,0;0;1,25;touched
P2;50;400;10,0;0;1,40;
"""


def test_groups_stand_over_names_that_say_enough(tmp_path: Path) -> None:
    """Force over Fx is Fx, Position over X is the position though the gauge's x is written small."""
    code, e = imported(Ugly(LAYERED, more=("--set", "z=0")), tmp_path)
    assert code == 0 and e is not None
    np.testing.assert_allclose(e.wrench[:, 0], 98.0665)
    np.testing.assert_allclose(e.position, [[0, 0.4, 0], [0.05, 0.4, 0]])
    np.testing.assert_allclose(e.reading[:, 0], [12.5e-6, 14e-6])
    record = dict(e.record)
    assert (record["operator"], record["instrument"]) == ("M. Weber", "3 dial gauges")


def test_a_missing_load_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert imported(Ugly(CLEAN.replace("fx [N]", "pull [N]")), tmp_path)[0] == 2
    err = capsys.readouterr().err
    assert "--map fx='HEADER'" in err and "'pull [N]'" in err


def test_what_is_left_out_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert imported(UGLY["means at the end"], tmp_path)[0] == 0
    out = capsys.readouterr().out
    assert "left out: row 6, 'Mean', is no reading" in out
    assert "left out: row 8 is a remark: Signed: Miller" in out


@pytest.mark.parametrize(
    "word", ["Moyenne", "Écart-type", "Promedio", "Media", "Desviación", "Máximo", "Totale", "Anzahl", "n", "3 sigma", "Toleranz"]
)  # fmt: skip
def test_what_is_computed_is_no_reading_in_any_language(word: str, tmp_path: Path) -> None:
    rows = "".join(f"P{i};{x};{y};{fx};{dx};{dy}\n" for i, (x, y, fx, dx, dy) in enumerate(TRUTH))
    text = f"Nr;x [mm];y [mm];fx [N];dx [um];dy [um]\n{rows}{word};1;2;3;4;5\n"
    code, e = imported(Ugly(text), tmp_path)
    assert code == 0 and e is not None
    matches(e, Ugly(text))


@pytest.mark.parametrize("blank", ["\u00a0", "\u2009", "\u202f", "\u2007", " "])
def test_thousands_behind_any_blank(blank: str, tmp_path: Path) -> None:
    text = (
        f"x [mm];y [mm];fx [N];dx [um]\n0,0;400,0;1{blank}234,5;12,5\n0,0;400,0;\u22121{blank}000,0;-10,0\n"
    )
    _, e = imported(Ugly(text), tmp_path)
    assert e is not None and e.wrench[:, 0].tolist() == [1234.5, -1000.0]


@pytest.mark.parametrize("first", ['"1,000.5"', "0"])
def test_a_thousand_in_quotes_is_refused(
    first: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Next to a point or between commas it is no decimal comma, which would be off by a thousand."""
    text = f'x [mm],y [mm],fx [N],dx [um]\n{first},400,"1,500",12\n0,400,"-1,500",-12\n'
    assert imported(Ugly(text), tmp_path)[0] == 2
    assert "column 'fx [N]': expected a number; found '1,500'" in capsys.readouterr().err


def test_points_that_are_read_again_have_names_of_their_own(tmp_path: Path) -> None:
    _, e = imported(UGLY["repeated points"], tmp_path)
    assert e is not None and e.ids == ("A", "A.2", "B")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("14.0", "soft", "line 3: column 'dx [µm]': expected a number; found 'soft' (cell E3)"),
        (
            "2;50;400;100;14.0",
            "2;50;400;100 N;14.0",
            "line 3: column 'fx [N]': expected a number; found '100 N' (cell D3)",
        ),
        (
            "fx [N];dx [µm]\n1;0;400;100;12.5\n2;50;400;100;14.0",
            "fx [N];dx [µm]\n1;0;400;100 N;12.5\n2;50;400;0.1 kN;14.0",
            "line 3: column 'fx [N]': expected N in its cells; found kN",
        ),
        ("12.5\n2;50;400;100;14.0", "-\n2;50;400;100;", "no row has a reading: no number in 'dx'"),
        ("2;50;", "2;;", "line 3: column 'x [mm]' (B): expected a number; found an empty cell"),
        (
            "fx [N]",
            "fx [stone]",
            "the unit 'stone' is not known; those of force are: N, daN, kN, kgf, kp, lbf",
        ),
        ("dx [µm]", "dx [kN]", "the unit 'kN' is not one of this quantity; those of length are: m, cm, mm"),
    ],
)
def test_errors_name_the_sheet_and_leave_nothing(
    old: str, new: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert imported(Ugly(CLEAN.replace(old, new)), tmp_path)[0] == 2
    err = capsys.readouterr().err
    assert words in err and "sheet.csv" in err and "data.csv" not in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sheet.csv"]


def test_a_workbook_names_sheet_row_and_cell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def fill(book: Any) -> None:
        book.active.title = "March"
        book.active.append(["x [mm]", "y [mm]", "z [mm]", "fx [N]", "dx [µm]"])
        book.active.append([0, 400, 0, 100, 12.5])
        book.active.append([50, 400, 0, 100, "soft"])

    assert imported(Ugly(fill), tmp_path)[0] == 2
    err = capsys.readouterr().err
    assert "sheet 'March', line 3: column 'dx [µm]': expected a number; found 'soft' (cell E3)" in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sheet.xlsx"]


def test_a_failure_leaves_an_old_experiment_alone(tmp_path: Path) -> None:
    assert imported(Ugly(CLEAN), tmp_path)[0] == 0
    before = (tmp_path / "e/data.csv").read_text(encoding="utf-8")
    bad = Ugly(CLEAN.replace("2;50;", "2;;"), more=("--set", "z=0", "--overwrite"))
    assert imported(bad, tmp_path)[0] == 2
    assert (tmp_path / "e/data.csv").read_text(encoding="utf-8") == before


def test_a_workbook_names_its_sheets_where_none_fits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def fill(book: Any) -> None:
        book.active.title = "Cover"
        page = book.create_sheet("March")
        page.append(["x [mm]", "y [mm]", "fx [N]", "q"])
        page.append([0, 400, 100, 3])

    assert imported(Ugly(fill), tmp_path)[0] == 2
    err = capsys.readouterr().err
    assert "none of its 2 sheets fits" in err and "'Cover': the sheet is empty" in err and "'March': " in err


def answering(monkeypatch: pytest.MonkeyPatch, answers: list[str]) -> list[str]:
    asked: list[str] = []

    def reply(text: str) -> str:
        asked.append(text)
        return answers[len(asked) - 1]

    monkeypatch.setattr("builtins.input", reply)
    return asked


ODD = "Stelle;Ost;Nord;Fx [N];Taster\n1;0;400;100;12.5\n2;50;400;100;14.0\n"


def test_a_dialogue_asks_and_remembers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = Ugly(ODD, more=("--dialogue",))
    asked = answering(monkeypatch, ["B", "C", "0", "dx=E", "mm", "mm", "furlong", "um", "2"])
    code, e = imported(sheet, tmp_path)
    assert code == 0, capsys.readouterr().err
    assert e is not None and len(asked) == 9
    np.testing.assert_allclose(e.reading[:, 0], [12.5e-6, 14e-6])
    np.testing.assert_allclose(e.sigma[:, 0], 2e-6)
    np.testing.assert_allclose(e.position, [[0, 0.4, 0], [0.05, 0.4, 0]])
    capsys.readouterr()
    code, e = imported(Ugly(ODD.replace("12.5", "13.5"), more=("--overwrite",)), tmp_path)  # no question
    assert code == 0 and "answers of an earlier sheet of this form are used" in capsys.readouterr().out
    assert (
        e is not None and e.reading[0, 0] == pytest.approx(13.5e-6) and e.sigma[0, 0] == pytest.approx(2e-6)
    )


def test_a_dialogue_without_answers_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def nobody(text: str) -> str:
        raise EOFError

    monkeypatch.setattr("builtins.input", nobody)
    assert imported(Ugly(ODD, more=("--dialogue",)), tmp_path)[0] == 2
    assert "--map, --unit or --set" in capsys.readouterr().err


def test_missing_openpyxl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "openpyxl", None)
    (tmp_path / "a.xlsx").write_bytes(b"PK")
    assert (
        main(
            [
                "experiment",
                "new",
                str(tmp_path / "a.xlsx"),
                "--machine",
                "five-bar",
                "-o",
                str(tmp_path / "e"),
            ]
        )
        != 0
    )
    assert "needs openpyxl, which is not installed: pip install 'stiffmap[excel]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "name", "factor"),
    [("kgf", "N", 9.80665), ("lbf", "N", 4.4482216152605), ("thou", "in", 1e-3), ("1/100 mm", "um", 10.0),
     ("in/1000", "in", 1e-3), ("0,01 mm", "um", 10.0), ("µm", "um", 1.0), ("[kN]", "kN", 1.0), ("kp", "N", 9.80665)],
)  # fmt: skip
def test_units(text: str, name: str, factor: float) -> None:
    found = unit_of(text)
    assert found is not None and (found.name, found.factor) == (name, factor)


def test_a_workbook_of_old_excel(tmp_path: Path) -> None:
    """`tests/data/readings.xls`: title, blank line, header in line 3, the rows of `TRUTH`."""
    pytest.importorskip("python_calamine")
    sheet = Path(__file__).parents[3] / "data/readings.xls"
    assert (
        main(
            [
                "experiment",
                "new",
                str(sheet),
                "--machine",
                "five-bar",
                "--set",
                "z=0",
                "-o",
                str(tmp_path / "e"),
            ]
        )
        == 0
    )
    matches(sm.load_experiment(tmp_path / "e"), Ugly(""))


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("dy=mm", "--unit dy: no column has this name or meaning; columns: Nr, x [mm]"),
        ("length=parsec", "--unit length: the unit 'parsec' is not known; known: m, cm, mm"),
    ],
)
def test_a_unit_of_nothing_is_refused(
    unit: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert imported(Ugly(CLEAN, more=("--set", "z=0", "--unit", unit)), tmp_path)[0] == 2
    assert message in capsys.readouterr().err

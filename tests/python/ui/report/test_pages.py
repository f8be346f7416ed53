"""Pages in headless Chromium: nothing overflows, no picture is missing, the console is silent."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tests.python.ui.report.browser import look
from tests.python.ui.report.planted import soft_drive

import stiffmap as sm
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.sentences import measured, sentence
from stiffmap.ui.cli import main
from stiffmap.ui.report.diagnosis.pictures import before_after, maps


def test_an_effect_is_said_as_one_says_it() -> None:
    parameters = {"scale": (2.148, 2.137, 2.159, "1"), "value": (3.007e-7, 2.992e-7, 3.023e-7, "m/N")}
    e = Effect("compliance", "actuator", ("z",), parameters, [], {})
    assert sentence(e) == (
        "The drive of leg z is 2.15 times as soft as in your file: 0.3007 ± 0.0008 µm/N instead of 0.14"
    )
    assert measured(12.34e-6, 11.0e-6, 13.7e-6, "m") == "12.3 ± 0.7 µm"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a diagnosis with a date, and beside it what it was made of."""
    path = tmp_path_factory.mktemp("report") / "r.html"
    path.with_name("data.csv").write_text("x", encoding="utf-8")
    soft_drive().report(path, date="14 March 2025", inputs=[path.with_name("data.csv")])
    return path


@pytest.mark.parametrize("width", [500, 794, 1200])  # a phone, A4, a screen
def test_the_report_of_a_diagnosis(width: int, report: Path, tmp_path: Path) -> None:
    assert look(report, tmp_path, width) == {"wide": 0, "lost": 0, "console": 0}


def test_measures_as_a_page_with_their_pictures(tmp_path: Path) -> None:
    only = "mass,transmission_max,accuracy"
    assert main(["measures", "orthoglide-revised", "--only", only, "--nodes", "3", "-o", str(tmp_path)]) == 0
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    pictures = sorted(p.name for p in tmp_path.glob("*.png"))
    assert pictures == ["map-accuracy.png", "map-transmission_max.png", "transmission.png"]
    assert text.count("<img") == len(pictures)
    assert "3 measures" in text and "[green]" not in text and "://" not in text


def test_a_broken_page_is_seen(tmp_path: Path) -> None:
    """What the other tests ask for can be missing."""
    page = tmp_path / "bad.html"
    page.write_text(
        "<!doctype html><html><body><div style='width:2000px'>x</div><img src='gone.png'>"
        "<script>nothing()</script></body></html>",
        encoding="utf-8",
    )
    found = look(page, tmp_path)
    assert found["wide"] > 500
    assert found["lost"] == 1
    assert found["console"] >= 1


@pytest.mark.parametrize("which", ["declared", "calibrated", "corrected"])
def test_pictures_say_which_machine_is_handed_over(which: str) -> None:
    d = replace(soft_drive(), which=which)
    named = [t.get_text() for t in before_after(d).axes[0].get_yticklabels()]
    assert named == ["your file", f"machine.yaml ({which})", "noise"]
    assert f"machine.yaml ({which})" in [ax.get_title() for ax in maps(d).axes]


def test_the_report_says_what_a_workshop_signs(report: Path, tmp_path: Path) -> None:
    text = report.read_text(encoding="utf-8")
    order = [
        "The drive of leg z is 2.15 times as soft as in your file",
        "What to do next",
        "Evidence",
        "without load (dashed), under it (enlarged)",
        "Where the deflection of machine.yaml",
        "What is left",
        "What this experiment could have seen",
        "Provenance",
    ]
    assert [text.index(part) for part in order] == sorted(text.index(part) for part in order)
    # of what went in: the caller's date, the version, the seed, SHA-256 of "x"
    for part in ("14 March 2025", sm.__version__, "<td>seed</td><td>1</td>", "sha256 2d711642b726b044"):
        assert part in text, part
    assert "0.301" in text
    assert "µm/N" in text
    assert "://" not in text
    again = tmp_path / "again.html"
    soft_drive().report(again, date="14 March 2025", inputs=[report.with_name("data.csv")])
    assert again.read_text(encoding="utf-8") == text  # no clock of its own
    soft_drive().report(again)
    assert "date</td><td>not given" in again.read_text(encoding="utf-8")

"""Pages in headless Chromium: nothing overflows, no picture is missing, the console is silent."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.diagnosis.report.findings import Effect
from stiffmap.diagnosis.report.sentences import measured, sentence
from stiffmap.report.page import write_page

sys.path.insert(0, str(Path(__file__).parent))
from browser import look


@pytest.mark.parametrize("width", [500, 900])
def test_the_page_of_a_loaded_machine(width: int, tmp_path: Path) -> None:
    page = write_page(sm.load_machine("five-bar"), tmp_path / "m.html", None, [0, -100.0, 0, 0, 0, 0])
    assert look(page, tmp_path, width) == {"wide": 0, "lost": 0, "console": 0}


def test_an_effect_is_said_as_one_says_it() -> None:
    parameters = {"scale": (2.148, 2.137, 2.159, "1"), "value": (3.007e-7, 2.992e-7, 3.023e-7, "m/N")}
    e = Effect("compliance", "actuator", ("z",), parameters, [], {})
    assert sentence(e) == (
        "The drive of leg z is 2.15 times as soft as in your file: 0.3007 ± 0.0008 µm/N instead of 0.14"
    )
    assert measured(12.34e-6, 11.0e-6, 13.7e-6, "m") == "12.3 ± 0.7 µm"

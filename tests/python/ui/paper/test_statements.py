"""The table of statements: its rules, its numbers against closed forms, its formats."""

from __future__ import annotations

import io
import json
import re
from dataclasses import asdict

import numpy as np
import pytest
from rich.console import Console

import stiffmap as sm
from stiffmap.ui.paper import Results, Statement, StatementVerdict, all_statements, compute
from stiffmap.ui.paper.directions import RIGID, over_fx, ratio_of
from stiffmap.ui.paper.machine import diagonal_limits, factors
from stiffmap.ui.paper.statement import as_markdown, as_rich, as_table, count_text, rounds_to


@pytest.fixture(scope="module")
def results() -> Results:
    return compute(5, progress=False)


@pytest.fixture(scope="module")
def statements(results: Results) -> list[Statement]:
    return all_statements(results)


def find(statements: list[Statement], words: str) -> Statement:
    (found,) = (s for s in statements if words in s.words)
    return found


@pytest.mark.parametrize(
    ("ours", "printed", "same"),
    [
        (600.9, "600", True),
        (655.0, "600", False),
        (24.4, "20", True),
        (40.4, "20", False),
        (6.6, "7", True),
        (4.96, "7", False),
        (0.14, "0.1", True),
        (0.16, "0.1", False),
        (310.04, "310.0", True),
    ],
)
def test_rounding_to_the_printed_digits(ours: float, printed: str, same: bool) -> None:
    assert rounds_to(ours, printed) is same


@pytest.mark.parametrize("name", ["orthoglide-original", "orthoglide-revised"])
def test_transmission_factors_against_the_closed_form(name: str) -> None:
    machine = sm.load_machine(name)
    length = {"orthoglide-original": 0.310, "orthoglide-revised": 0.775}[name]
    for q in (-0.2 * length, 0.1 * length, 0.3 * length):
        t = q / np.sqrt(length**2 - 2 * q**2)
        expected = np.sort([1 / (1 + 2 * t), 1 / (1 - t), 1 / (1 - t)])[::-1]
        np.testing.assert_allclose(factors(machine, np.full(3, q)), expected, rtol=1e-7)
    low, high = diagonal_limits(machine, 0.5, 2.0, 0.42 * length)
    assert low == pytest.approx(-length / np.sqrt(18), rel=1e-7)
    assert high == pytest.approx(length / np.sqrt(6), rel=1e-7)


def test_near_misses_are_reported(statements: list[Statement]) -> None:
    original = find(statements, "cubic Cartesian workspace")
    assert original.numbers["edge_mm"] == pytest.approx(199.62, abs=0.005)
    assert original.verdict is StatementVerdict.DIFFERS
    assert find(statements, "required workspace").numbers["edge_mm"] == pytest.approx(499.06, abs=0.005)
    assert find(statements, "transmission factor range").numbers["largest_factor"] == pytest.approx(
        2.244, abs=5e-4
    )


def test_ratio_and_maximum_are_tied_on_the_diagonal(results: Results) -> None:
    c = results.revised.solve([-0.2, -0.2, -0.2]).compliance[:2, :2]
    size = np.linalg.svd(c, compute_uv=False)
    assert over_fx(size[0] / size[1]) == pytest.approx(size[0] / np.linalg.norm(c[:, 0]), rel=1e-9)
    assert ratio_of(over_fx(4.2)) == pytest.approx(4.2)
    assert over_fx(7.0) == pytest.approx(1.40, abs=5e-3)


def test_statements_follow_from_independent_solves(results: Results, statements: list[Statement]) -> None:
    m = results.revised
    d = {
        c: m.solve([0.3, 0.3, 0.3], w).displacement[:2]
        for c, w in {"Fx": [300.0, 0, 0, 0, 0, 0], "worst": [300 / 2**0.5, -300 / 2**0.5, 0, 0, 0, 0]}.items()
    }
    less = 100 * (1 - np.linalg.norm(d["Fx"]) / np.linalg.norm(d["worst"]))
    assert find(statements, "20% less").numbers["percent"] == pytest.approx(less, abs=0.01)
    limit = find(statements, "up to 600 N").numbers["limit_N"]
    at = m.solve(np.zeros(3), [limit, 0, 0, 0, 0, 0]).displacement[:2]
    assert np.linalg.norm(at) == pytest.approx(0.25e-3, rel=1e-3)


def test_every_quantity_of_the_text_is_there(statements: list[Statement]) -> None:
    text = " ".join(s.words for s in statements)
    for quantity in (
        "200×200×200",
        "1.2 m/s",
        "14 m/s²",
        "4 kg",
        "0.5–2.0",
        "L = 310",
        "3.54e-1",
        "π/2",
        "7 times",
        "20% higher",
        "20% less",
        "50% more",
        "about 7",
        "1000 N",
        "600 N",
        "100 N",
        "1 mm and more",
        "0,1 mm",
        "zero plane",
        "0.4 mm",
        "0.5 mm",
        "0,2 mm",
        "more than 3 times",
    ):
        assert quantity in text, quantity
    assert all(s.because or s.verdict is StatementVerdict.AGREES for s in statements)
    assert {s.verdict for s in statements} == set(StatementVerdict)


def test_rigid_foot_and_drives_leave_the_bars(results: Results) -> None:
    """At the isotropic point only the two bars in parallel remain along x."""
    stiff = results.revised
    for element in ("foot", "actuator"):
        stiff = stiff.with_effect("compliance", element=element, scale=RIGID)
    assert stiff.solve(np.zeros(3)).compliance[0, 0] == pytest.approx(3.10e-8 / 2, rel=0.05)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_every_line_fits_the_terminal(statements: list[Statement], width: int) -> None:
    console = Console(width=width, file=io.StringIO(), highlight=False)
    console.print(as_rich(statements))
    text = console.file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    assert " ".join(text.split()).count("ours: ") == len(statements)


def test_own_inputs_are_no_agreement(statements: list[Statement]) -> None:
    """What our machine files were given is marked, and nothing that is computed from more."""
    own = {s.words[:12] for s in statements if s.own_input}
    assert own == {
        "Cartesian ve",
        "L = 310 mm, ",
        "Table 1, ori",
        "Table 1, rev",
        "the length a",
        "new stiffnes",
    }
    agree = sum(s.verdict is StatementVerdict.AGREES for s in statements)
    assert f"{agree} agree (6 of them are inputs of our model, {agree - 6} are results)" in count_text(
        statements
    )


def test_the_papers_numbers_are_its_words(statements: list[Statement]) -> None:
    """Digits that we call the paper's occur in its words, but for the tolerance and the half metre of §5.1."""
    for s in statements:
        assert s.printed, s.words
        words = s.words.replace("π/2", "90").replace(",", ".").replace(".", "") + " 025 500"
        for digits in re.findall(r"\d+(?:\.\d+)?", s.printed):
            assert digits.replace(".", "").rstrip("0") in words or digits in s.words, (s.words, digits)


def test_formats_hold_the_same_rows(statements: list[Statement]) -> None:
    head, rows = as_table(statements)
    assert len(rows) == len(statements) and {*map(len, rows)} == {len(head)}
    assert rows[0][1] == statements[0].words
    assert as_markdown(statements).count("\n") == len(statements) + 2
    json.dumps([asdict(s) for s in statements], allow_nan=False)

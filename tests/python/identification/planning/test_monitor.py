"""Changes against noise, budgets against the law of propagation, figures of the standards worked by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import random_plan, save_experiment, simulate
from stiffmap.experiment.calls import placed
from stiffmap.identification.planning.budget import BudgetLine, NumberBudget, budgets
from stiffmap.identification.planning.changes import monitor as compare
from stiffmap.identification.planning.estimate import estimate
from stiffmap.ui.cli.app import main


@pytest.fixture(scope="module")
def orthoglide() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture(scope="module")
def plan(orthoglide: sm.Machine) -> sm.Experiment:
    return random_plan(orthoglide, poses=6, loads=4, repeats=1)


def twin(machine: sm.Machine, plan: sm.Experiment, scale: float, seed: int) -> sm.Experiment:
    return simulate(machine, plan, [placed(machine, f"compliance actuator x scale={scale}")], seed=seed)


def test_a_change_is_seen_and_none_is_invented(orthoglide: sm.Machine, plan: sm.Experiment) -> None:
    term = [placed(orthoglide, "compliance actuator x scale=1")]
    first = twin(orthoglide, plan, 1.3, 0)
    moved = compare(orthoglide, first, twin(orthoglide, plan, 1.5, 1), term)
    assert not moved.common
    assert moved.changes[0].changed
    assert moved.changes[0].after - moved.changes[0].before == pytest.approx(0.2, abs=4 * moved.changes[0].u)
    p_values = [compare(orthoglide, first, twin(orthoglide, plan, 1.3, s), term).p for s in range(2, 14)]
    assert min(p_values) > 1e-4


def test_rows_out_of_reach_are_said(orthoglide: sm.Machine, plan: sm.Experiment) -> None:
    first = twin(orthoglide, plan, 1.3, 0)
    position = first.position.copy()
    position[-1, 0] = 5.0
    far = replace(first, position=position)
    found = compare(orthoglide, first, far, [placed(orthoglide, "compliance actuator x scale=1")])
    (text,) = found.as_plain()["left_out"]
    assert "no equilibrium at 1 row" in text and f"left out: {text}" in str(found)


def test_the_command_line(
    orthoglide: sm.Machine, plan: sm.Experiment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, scale in (("a", 1.3), ("b", 1.5)):
        save_experiment(twin(orthoglide, plan, scale, 0), tmp_path / name)
    told = {
        "effects": [
            {"kind": "compliance", "element": "actuator", "legs": ["x"], "parameters": {"scale": [1.3]}}
        ]
    }
    (tmp_path / "d.json").write_text(json.dumps(told))
    both = ["monitor", "orthoglide-revised", str(tmp_path / "a"), str(tmp_path / "b")]
    assert main([*both, "--diagnosis", str(tmp_path / "d.json"), "--budget"]) == 1
    out = capsys.readouterr().out
    assert "changed" in out
    assert "U (k = 2)" in out
    assert main(both) == 2
    (tmp_path / "d.json").write_text("[]")
    assert main([*both, "--diagnosis", str(tmp_path / "d.json")]) == 2
    assert "d.json" in capsys.readouterr().err


def test_an_unfitted_dimension_moves_the_number_as_the_budget_says(
    orthoglide: sm.Machine, plan: sm.Experiment
) -> None:
    term = placed(orthoglide, "compliance actuator x scale=1")
    other = placed(orthoglide, "compliance foot x scale=1")
    exact = twin(orthoglide, plan, 1.2, 3)
    found = estimate(orthoglide, exact, [term])
    line = next(
        x for x in budgets(orthoglide, exact, found, [(other, {"scale": 0.05})])[0].lines if x.kind == "B"
    )
    bent = orthoglide.with_effect("compliance", element="foot", legs=["x"], scale=1.05)
    shift = estimate(bent, exact, [term]).values[0] - found.values[0]
    assert line.u == pytest.approx(abs(shift), rel=0.1)
    with pytest.raises(sm.StiffmapError, match="no number 'width'"):
        budgets(orthoglide, exact, found, [(other, {"width": 1.0})])


def test_welch_and_satterthwaite() -> None:
    """Example H.1 of JCGM 100 in outline: 25 nm of 18, 9.7 of 25.6, the rest taken as exact."""
    b = NumberBudget(
        "length", "m", 0.05, (BudgetLine("standard", "B", 25.0, 18.0), BudgetLine("repeats", "A", 9.7, 25.6))
    )
    assert b.u == pytest.approx(np.hypot(25.0, 9.7))
    assert b.freedom == pytest.approx(b.u**4 / (25.0**4 / 18 + 9.7**4 / 25.6))
    assert b.expanded == pytest.approx(2 * b.u)


def test_what_a_model_leaves_is_no_change(orthoglide: sm.Machine) -> None:
    """Two sides of the workspace, of a machine that is off elsewhere, too; a change at the same poses is seen beside that."""
    term = [placed(orthoglide, "zero_offset actuator x error=0um")]
    off = [
        placed(orthoglide, text)
        for text in (
            "length bar x error=0.15mm",
            "length bar y error=-0.1mm",
            "parallelogram_width parallelogram z error=0.05mm",
            "lead_error actuator y slope=300e-6",
            "periodic_error actuator y amplitude=20um period=120mm phase=10deg",
        )
    ]
    plan = random_plan(orthoglide, "position", poses=240, repeats=1, seed=4)
    whole = simulate(orthoglide, plan, off, seed=1)
    for seed in (1, 3, 5):  # misfits alone find changes in two of these, p = 0.01 and 0.005
        along = whole.position @ np.random.default_rng(seed).standard_normal(3)
        half = along < np.median(along)
        assert compare(orthoglide, whole.rows(half), whole.rows(~half), term).p > 0.1
    later = simulate(
        orthoglide, plan, [*off, placed(orthoglide, "zero_offset actuator x error=0.02mm")], seed=2
    )
    found = compare(orthoglide, whole, later, term)
    assert found.changes[0].changed
    assert found.changes[0].after - found.changes[0].before == pytest.approx(2e-5, abs=4 * found.changes[0].u)
    assert found.changes[0].u < 2e-6  # what is left is the same at the same poses

"""Changes against noise, budgets against the law of propagation, figures of the standards worked by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import random_plan, save_experiment, simulate
from stiffmap.experiment.calls import placed
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.virtual.plans import with_distances, with_joints
from stiffmap.identification.diagnosis.report.result import diagnosed
from stiffmap.identification.planning.budget import BudgetLine, NumberBudget, budgets
from stiffmap.identification.planning.changes import Change, monitor as compare
from stiffmap.identification.planning.design import follow
from stiffmap.identification.planning.estimate import Estimate, estimate
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


@pytest.mark.parametrize(
    ("effect", "word"), [("compliance actuator x scale=1", 0), ("length bar y error=0um", 1)]
)
def test_what_is_followed_may_not_explain_the_readings(
    orthoglide: sm.Machine, plan: sm.Experiment, effect: str, word: int
) -> None:
    found = compare(orthoglide, simulate(orthoglide, plan, seed=0), twin(orthoglide, plan, 1.5, 1), effect)
    assert len(found.as_plain()["unexplained"]) == word
    assert str(found).count("does not explain the readings") == word


@pytest.mark.parametrize(
    ("unit", "shown"), [("m", "0.0100 -> 0.0130 mm (0.003"), ("1", "0.0000100 -> 0.0000130 1")]
)
def test_lengths_of_changes_are_in_millimetres(unit: str, shown: str) -> None:
    text = str(Change("gap: half_width", unit, 1e-5, 1.3e-5, 1e-6, 0.0))
    assert shown in text and " m " not in text


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
            {
                "kind": "compliance",
                "element": "actuator",
                "legs": ["x"],
                "parameters": {"scale": [1.3, 1.2, 1.4, "1"]},
            }
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


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("orthoglide-revised", ("compliance", "actuator", ["z"], {"scale": 1.2, "value": 1.69e-7})),
        ("orthoglide-revised", ("compliance", "foot.k11", ["x"], {"scale": 1.2, "value": 3e-8})),
        ("ur10", ("compliance", "shoulder", ["arm"], {"scale": 1.5, "value": 3e-6})),
        ("orthoglide-revised", ("compliance", "actuator", ["z"], {"value": 1.69e-7})),
        ("orthoglide-revised", ("periodic_error", "actuator", ["x"], {"amplitude": 1e-5, "period": 0.02})),
    ],
)
def test_effects_of_a_diagnosis_are_followed_in_the_number_that_was_fitted(
    name: str, found: tuple[str, str, list[str], dict[str, float]], tmp_path: Path
) -> None:
    kind, element, legs, numbers = found
    parameters = {n: [v, 0.9 * v, 1.1 * v, ""] for n, v in numbers.items()}
    effect = {"kind": kind, "element": element, "legs": legs, "parameters": parameters}
    (tmp_path / "d.json").write_text(json.dumps({"effects": [effect]}))
    (term,) = diagnosed(tmp_path / "d.json")
    kept = dict(placed(sm.load_machine(name), term).parameters)
    assert kept == (dict([*numbers.items()][:1]) if kind == "compliance" else numbers)


@pytest.mark.parametrize("clock", ["order", "hours", "setup"])
def test_drift_of_one_session_says_nothing_of_the_other(orthoglide: sm.Machine, clock: str) -> None:
    """Each drifts by itself, though their clocks begin alike: 9 standard uncertainties of nothing, rms, where they share it."""

    def session(seed: int) -> sm.Experiment:
        plan = random_plan(orthoglide, "position", poses=60, repeats=1, seed=seed)
        n = np.arange(60.0)
        course = np.linalg.cholesky(np.exp(-np.abs(np.subtract.outer(n, n)) / 20.0))
        drift = 5e-5 * course @ np.random.default_rng(seed).standard_normal((60, 3))
        read = simulate(orthoglide, plan, seed=seed)
        more = {"hours": {"hours": n / 10}, "setup": {"setup": ("A",) * 60}}.get(clock, {})
        return replace(read, reading=read.reading + np.pad(drift, ((0, 0), (0, 3))), **more)  # type: ignore[arg-type]

    found = [
        compare(orthoglide, session(s), session(s + 1), "zero_offset actuator x error=0um")
        for s in (10, 30, 50)
    ]
    pulls = [(c.after - c.before) / c.u for f in found for c in f.changes]
    assert np.sqrt(np.mean(np.square(pulls))) < 2.5


@pytest.mark.parametrize("other", ["quantity", "encoder", "distance"])
def test_experiments_that_read_other_things_are_not_taken_together(
    orthoglide: sm.Machine, other: str
) -> None:
    plan = random_plan(orthoglide, "position", poses=6, repeats=1)
    unlike = {
        "quantity": random_plan(orthoglide, poses=6, loads=2, repeats=1),
        "encoder": with_joints(plan, [Channel("q_x", "m", "x.actuator")], [1e-6]),
        "distance": with_distances(plan, 8e-6),
    }[other]
    first, then = (simulate(orthoglide, p) for p in (plan, unlike))
    with pytest.raises(
        sm.StiffmapError, match=r"plan: expected the same readings as in plan \(position\), found"
    ):
        compare(orthoglide, first, then, "length bar x error=1um")
    with pytest.raises(sm.StiffmapError, match="expected the same readings"):
        sm.plan(orthoglide, "length bar x error=1um", rows=2, candidates=first, done=then)


WRONG: dict[str, Callable[[sm.Machine, sm.Experiment, Estimate], object]] = {
    "terms: expected effects": lambda m, e, _: estimate(m, e, None),  # type: ignore[arg-type]
    "terms: expected at least one effect": lambda m, e, _: estimate(m, e, []),
    "experiment: expected an Experiment": lambda m, e, _: estimate(m, [e], TERM),  # type: ignore[arg-type]
    "expected a machine": lambda m, e, _: estimate(3, e, TERM),  # type: ignore[arg-type]
    "found: expected an Estimate": lambda m, e, _: budgets(m, e, 1.5),  # type: ignore[arg-type]
    "others: expected pairs": lambda m, e, x: budgets(m, e, x, [TERM]),  # type: ignore[list-item]
    "others: scale: expected a standard": lambda m, e, x: budgets(m, e, x, [(TERM, {"scale": -1.0})]),
    "others: scale: expected a number": lambda m, e, x: budgets(m, e, x, [(TERM, {"scale": "1"})]),  # type: ignore[dict-item]
    "measure: expected a function": lambda m, e, _: follow(m, TERM, e, until=1.0),  # type: ignore[arg-type]
    "until: expected a number": lambda m, e, _: follow(m, TERM, lambda p: p, until=float("nan")),
}
TERM = "compliance actuator x scale=1"


@pytest.mark.parametrize("message", WRONG)
def test_what_is_no_input_is_refused_by_name(
    orthoglide: sm.Machine, plan: sm.Experiment, message: str
) -> None:
    e = twin(orthoglide, plan, 1.2, 3)
    with pytest.raises(sm.StiffmapError, match=message):
        WRONG[message](orthoglide, e, estimate(orthoglide, e, TERM))


def test_names_and_texts_serve_as_well(orthoglide: sm.Machine, plan: sm.Experiment, tmp_path: Path) -> None:
    e = twin(orthoglide, plan, 1.2, 3)
    save_experiment(e, tmp_path / "e")
    whole = estimate(orthoglide, e, [placed(orthoglide, TERM)])
    named = estimate("orthoglide-revised", tmp_path / "e", TERM)
    assert named.values == pytest.approx(whole.values, rel=1e-6)
    lines = [
        budgets("orthoglide-revised", e, whole, [(other, {"scale": 0.05})])[0].lines[-1].u
        for other in ("compliance foot x scale=1", placed(orthoglide, "compliance foot x scale=1"))
    ]
    assert lines[0] == lines[1] > 0.0


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
    assert str(b).startswith("length: 50 mm, u = 2.68e+04,") and "\n  repeats (A): 9.7e+03" in str(b)


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

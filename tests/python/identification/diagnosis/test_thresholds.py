"""Every number that decides a verdict, from both sides: what is just above it and what is just below."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.decision import beside_calibration, few, judge, largest_residual
from stiffmap.identification.diagnosis.decision.few import Few
from stiffmap.identification.diagnosis.decision.stability import steady
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.significance import global_p, needed
from stiffmap.model.effects import Parameter

ONE = Candidate("length", "bar", ("x",), (Parameter("error", "m", -1.0, 1.0, 0.0, 1e-4, ""),))
QUIET: Any = SimpleNamespace(say=lambda *_: None, over=False)


@pytest.fixture(scope="module")
def plan() -> Experiment:
    return random_plan(sm.load_machine("orthoglide-revised"), "position", poses=60, seed=3)


@pytest.mark.parametrize("trials", [1.0, 50.0, 3000.0])
def test_one_false_name_in_ten_thousand_searches(trials: float) -> None:
    assert global_p(needed(trials), trials) == pytest.approx(1e-4, rel=1e-9)
    assert needed(trials) == pytest.approx(np.log(trials) + 4 * np.log(10), abs=1e-4)  # M exp(-x) = 1e-4


@pytest.mark.parametrize(("change", "same"), [(0.34, True), (0.36, False)])
def test_an_effect_may_change_by_a_third_between_halves(plan: Experiment, change: float, same: bool) -> None:
    """A column of ones, far larger than noise: the upper half along x wants the value `change` larger."""
    upper = plan.position[:, 0] > np.median(plan.position[:, 0])
    j = np.full((len(upper), 1), 1e6)
    model = Model((ONE,), np.array([1.0]), 0.0, j, -j[:, 0] * np.where(upper, change, 0.0))
    problem: Any = SimpleNamespace(experiment=plan, index=(np.arange(len(upper)),))
    assert steady(problem, model) == [same]


def test_noise_is_allowed_for_between_halves(plan: Experiment) -> None:
    """Three standard deviations of a half: the change of 0.36 is none where they are 0.02."""
    upper = plan.position[:, 0] > np.median(plan.position[:, 0])
    for spread, same in ((0.0002, False), (0.02, True)):
        j = np.full((len(upper), 1), 1 / (spread * np.sqrt(upper.sum())))
        model = Model((ONE,), np.array([1.0]), 0.0, j, -j[:, 0] * np.where(upper, 0.36, 0.0))
        problem: Any = SimpleNamespace(experiment=plan, index=(np.arange(len(upper)),))
        assert steady(problem, model) == [same]


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.81, "effects+unattributed"), (0.79, "unattributed")], ids=["more", "less"]
)
def test_beside_a_rest_effects_explain_four_fifths(
    monkeypatch: pytest.MonkeyPatch, share: float, verdict: str
) -> None:
    model = SimpleNamespace(candidates=(ONE,))
    selection = SimpleNamespace(null=None)
    finding: Any = SimpleNamespace(
        selection=selection, search=SimpleNamespace(problem=SimpleNamespace(freedom=9)), model=model
    )
    for name, value in {
        "unexplained": ["a pattern"],
        "outweighing": model,
        "explained": share,
        "steady": [True],
        "with_model": finding,
        "_bare": finding,
    }.items():
        monkeypatch.setattr(judge, name, lambda *_, value=value: value)
    study: Any = SimpleNamespace(clock=QUIET)
    assert judge.judge(study, finding)[1] == verdict
    monkeypatch.setattr(judge, "steady", lambda *_: [True, False])
    assert judge.judge(study, finding)[1] == "unattributed"


@pytest.mark.parametrize(("p", "number"), [(1.1e-6, 0), (0.9e-6, 1)])
def test_a_check_refuses_below_one_in_a_million(
    monkeypatch: pytest.MonkeyPatch, p: float, number: int
) -> None:
    check = SimpleNamespace(contrasts=5, p=p, name="repeats", meaning="")
    monkeypatch.setattr(judge, "patterns", lambda *_: [])
    monkeypatch.setattr(judge, "after_checks", lambda *_: [check])
    model = SimpleNamespace(residual=np.zeros(3), tangent=lambda: None)
    finding: Any = SimpleNamespace(model=model, search=SimpleNamespace(problem=None))
    assert len(judge.unexplained(SimpleNamespace(), finding)) == number  # type: ignore[arg-type]


@pytest.mark.parametrize(("jump", "word"), [(0.03, "period"), (0.08, "step")])
def test_a_step_is_named_where_it_takes_four_fifths_of_what_waves_take(jump: float, word: str) -> None:
    """A ramp from -1 to 1 with a jump in its middle; the wave that fits best is a sine."""
    x = np.linspace(-1.0, 1.0, 400)
    y = x + jump * np.sign(x)
    step = 400 * y[x > 0].mean() ** 2
    waves = [np.sin(0.5 * np.pi * k * x) for k in np.arange(1.0, 12.01, 0.25)]
    wave = max(float(w @ y) ** 2 / float(w @ w) for w in waves)
    assert (0.77 < step / wave < 0.8) if word == "period" else (0.8 < step / wave < 0.84)
    assert word in largest_residual._wave("x", x, y, "µm")


def evidence_of(*chi2: float) -> Few:
    """So many effects of one direction each, on a hundred readings."""
    which = tuple(range(len(chi2) - 1))
    screen: Any = None
    return Few(screen, which, np.zeros(100), chi2, tuple(range(len(chi2))))


def test_a_second_fault_costs_ten_nats() -> None:
    """Schwarz's price of a direction, ln of the trials for each effect, and ten for every one beyond the first."""
    trials = 40.0
    each = 0.5 * np.log(100) + np.log(trials)
    assert evidence_of(1000.0, 900.0).evidence(trials) == pytest.approx(-450 - each)
    assert evidence_of(1000.0, 900.0, 0.0).evidence(trials) == pytest.approx(-2 * each - 10)
    assert evidence_of(1000.0, 900.0, 800.0, 0.0).evidence(trials) == pytest.approx(-3 * each - 20)
    assert evidence_of(1.0, 0.0).evidence(trials) == pytest.approx(
        -0.5
    )  # none is better than one for nothing


@pytest.mark.parametrize(
    ("lead", "wrong", "so"),
    [(29.9, 0.0, False), (30.1, 0.0, True), (34.9, 10.0, False), (35.1, 10.0, True)],
)
def test_uncertain_numbers_lead_by_thirty_nats(
    monkeypatch: pytest.MonkeyPatch, lead: float, wrong: float, so: bool
) -> None:
    """And by half the chi-square that the linear screen was wrong by."""
    found = evidence_of(1000.0, 80.0)
    monkeypatch.setattr(few, "fitted", lambda *_: 80.0 + wrong)
    study: Any = SimpleNamespace(whole=(SimpleNamespace(freedom=99),), effective_trials=1.0)
    assert few.not_few(study, found, found.evidence(1.0) + lead) is so


@pytest.mark.parametrize(("per_reading", "so"), [(24.9, False), (25.1, True)])
def test_few_effects_are_hopeless_at_25_per_reading(
    monkeypatch: pytest.MonkeyPatch, per_reading: float, so: bool
) -> None:
    found = evidence_of(1e6, per_reading * 98)
    monkeypatch.setattr(few, "fitted", lambda *_: found.chi2[-1])
    study: Any = SimpleNamespace(whole=(SimpleNamespace(freedom=99),), effective_trials=1.0)
    assert few.not_few(study, found, -np.inf) is so


@pytest.mark.parametrize(
    ("lead", "answer"), [(6.1, "effects"), (5.9, "ambiguous"), (3.1, "ambiguous"), (2.9, "layered")]
)
def test_effects_on_an_exact_machine_lead_by_three_nats_and_are_alone_from_six_on(
    monkeypatch: pytest.MonkeyPatch, lead: float, answer: str
) -> None:
    problem = SimpleNamespace()
    model = SimpleNamespace(candidates=(ONE,))
    finding = SimpleNamespace(model=model, search=SimpleNamespace(problem=problem))
    for name, value in {
        "calibrator": object(),
        "not_few": False,
        "screened": None,
        "find": finding,
        "judge": (finding, "effects", []),
        "admissible": (model, ()),
        "above_noise": (model, ()),
        "beside_time": (model, ()),
        "sparse_evidence": lead - 7.0,
        "spread_evidence": -7.0,
        "_layered": "layered",
    }.items():
        monkeypatch.setattr(beside_calibration, name, lambda *_, value=value: value)
    study: Any = SimpleNamespace(
        experiment=SimpleNamespace(quantity="position"), clock=QUIET, whole=(problem, None)
    )
    tolerances: Any = None
    got: Any = beside_calibration.find_effects(study, 0, tolerances)
    assert (got if isinstance(got, str) else got.verdict) == answer


@pytest.mark.parametrize(("rho", "answer"), [(0.29, "searched"), (0.31, "at the floor")])
def test_a_floor_is_worth_a_search_from_0_3_on(
    monkeypatch: pytest.MonkeyPatch, rho: float, answer: str
) -> None:
    for name, value in {
        "_above": None,
        "conclude": None,
        "_floor_beside_screen": rho,
        "_searched": SimpleNamespace(left=[], name="searched"),
        "_at_the_floor": SimpleNamespace(name="at the floor"),
    }.items():
        monkeypatch.setattr(beside_calibration, name, lambda *_, value=value: value)
    monkeypatch.setattr(beside_calibration, "Layer", SimpleNamespace(of=lambda *_: None))
    study: Any = SimpleNamespace(clock=QUIET)
    nothing: Any = None
    got: Any = beside_calibration._layered(study, nothing, 0, nothing)
    assert got.name == answer


@pytest.mark.parametrize(("nats", "so"), [(5.40, False), (5.42, True)])
def test_a_floor_is_rejected_where_chance_is_one_in_a_thousand(
    monkeypatch: pytest.MonkeyPatch, nats: float, so: bool
) -> None:
    blocks = SimpleNamespace(typical=2.0, log_likelihood=lambda rho: {0.25: nats - 3.0, 4.0: -3.0}[rho])
    monkeypatch.setattr(beside_calibration, "_left_by", lambda *_: blocks)
    monkeypatch.setattr(beside_calibration, "model_form", lambda _: 0.25)
    nothing: Any = None
    assert beside_calibration.rejected(nothing, nothing, rho=8.0) is so


@pytest.mark.parametrize(("along", "so"), [(0.951, True), (0.949, False)])
def test_uncertain_numbers_imitate_95_percent_of_a_signature(along: float, so: bool) -> None:
    """`along` of its squares in the direction of one number, the rest across."""
    signature = np.array([np.sqrt(along), np.sqrt(1 - along)])
    assert beside_calibration.imitated(np.array([[100.0], [0.0]]), signature) is so


@pytest.mark.parametrize(("standard", "so"), [(3.28, True), (3.30, False)])
def test_they_are_off_as_seldom_as_once_in_a_thousand(standard: float, so: bool) -> None:
    """3.29 standard uncertainties of one number, both sides; the readings say it exactly."""
    column = np.array([[1e6], [0.0]])
    assert beside_calibration.imitated(column, column[:, 0] * standard) is so


@pytest.mark.parametrize(("size", "so"), [(0.11, True), (0.09, False)])
def test_a_number_that_ten_standard_uncertainties_do_not_show_imitates_nothing(size: float, so: bool) -> None:
    assert beside_calibration.imitated(np.array([[size], [0.0]]), np.array([0.01, 0.0])) is so

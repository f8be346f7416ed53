"""The machine that is handed over: its optimum, which of three it is, and what it promises."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.experiment.channels import AXIS_CHANNELS
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import CandidatePlan
from stiffmap.identification.inference import machines
from stiffmap.identification.inference.amplitudes import fitted
from stiffmap.identification.inference.chosen import Term
from stiffmap.identification.inference.constants import RARE
from stiffmap.identification.inference.corrected import Corrected, along_travel, corrected, without
from stiffmap.identification.inference.kernels import Covariance
from stiffmap.identification.inference.names import infer
from stiffmap.identification.inference.parts import Parts
from stiffmap.identification.inference.readings import Readings
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted, sensitivity, zeros_anew
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import registry


def test_a_promise_is_what_estimates_from_other_poses_are_off_by(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against draws: numbers from their prior, a frame, a smooth gap that goes on from pose to pose, and noise."""
    rng = np.random.default_rng(0)
    n, p = 40, 4
    x = np.linspace(0.0, 1.0, n)
    columns = np.column_stack([rng.normal(size=(n, p - 1)), np.ones(n)])
    prior = np.array([1.0, 1.0, 1.0, 0.0])
    rest = 4.0 * np.exp(-(((x[:, None] - x) / 0.3) ** 2))
    e = SimpleNamespace(groups=np.arange(n), channels=AXIS_CHANNELS)
    factor = np.linalg.cholesky(rest + 1e-9 * np.eye(n))
    given: Any = SimpleNamespace(
        predictor=SimpleNamespace(experiment=e), rows=np.arange(n), channel=np.zeros(n, np.intp),
        sigma=np.full((n, 6), 2.0), weights=np.ones(n), rest=Covariance(np.ones(n), factor),
    )  # fmt: skip
    found: Any = SimpleNamespace(given=given)
    monkeypatch.setattr(machines, "columns_of", lambda *_: (columns, prior))
    size, u = machines.promised(found)
    covariance = rest + np.eye(n)
    label = np.random.default_rng(0).permutation(n) % machines.FOLDS
    draws = 4000
    beta = rng.normal(size=(p, draws)) * np.array([1.0, 1.0, 1.0, 5.0])[:, None]
    error = np.linalg.cholesky(covariance) @ rng.normal(size=(n, draws))
    squares = []
    for k in range(machines.FOLDS):
        seen, out = label != k, label == k
        w = np.linalg.inv(covariance[np.ix_(seen, seen)])
        b = columns[seen]
        estimate = np.linalg.solve(b.T @ w @ b + np.diag(prior), b.T @ w @ (b @ beta + error[seen]))
        squares.append((columns[out] @ (beta - estimate) + error[out]) ** 2)
    assert size == pytest.approx(2.0 * np.sqrt(np.mean(np.concatenate(squares))), rel=0.02)
    assert u == pytest.approx(size / np.sqrt(2.0 * n))


@pytest.mark.parametrize(("declared", "best"), [(1.0, "corrected"), (0.97, "corrected"), (0.5, "declared")])
def test_the_corrected_machine_is_handed_over_unless_another_is_clearly_better(
    declared: float, best: str
) -> None:
    rng = np.random.default_rng(3)
    left = {"corrected": rng.normal(size=(30, 3)), "declared": declared * rng.normal(size=(30, 3))}
    assert machines._best(left, "corrected", np.ones((30, 3)), np.arange(30)) == best


def test_the_machine_that_predicts_most_poses_better_is_handed_over_and_none_that_fails() -> None:
    """By 40 % in all poses but one, where a row slipped and the other has bent towards it; a machine without a pose leaves nothing of it."""
    rng = np.random.default_rng(3)
    corrected = rng.normal(size=(30, 3))
    plain, failed = 0.6 * rng.normal(size=(30, 3)), 0.1 * rng.normal(size=(30, 3))
    corrected[4], plain[4], failed[7] = 20.0, 40.0, np.nan
    left = {"declared": 30.0 * corrected, "plain": plain, "failed": failed, "corrected": corrected}
    assert machines._best(left, "corrected", np.full((30, 3), 0.5), np.arange(30)) == "plain"
    left = {name: np.full((30, 3), np.nan) for name in left}
    assert machines._best(left, "corrected", np.ones((30, 3)), np.arange(30)) == "corrected"


@pytest.mark.parametrize("together", [True, False])
def test_a_plain_calibration_has_no_gaps_and_nothing_of_a_set_up(
    together: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Zeros off in an arm with a smooth error that no number has, read in two set-ups."""
    if together:  # all numbers are then off alike, those of set-ups among them
        monkeypatch.setattr(machines, "of_noise_alone", lambda c: fitted(c, Parts(c).together[:1]))
    machine = sm.load_machine("ur10")
    plan = random_plan(machine, "position", poses=24, repeats=1, seed=1)
    plan = replace(plan, setup=tuple("ab"[int(g) % 2] for g in plan.groups))
    p = Predictor(machine, plan)
    wanted = [u for u in unknowns(machine.description, p.experiment) if u.group == "zeros"]
    rng = np.random.default_rng(2)
    wave = 1e-4 * np.sin(p.experiment.position[:, :1] * 8.0) * (np.arange(6) < 3)
    noise = np.nan_to_num(p.experiment.sigma) * rng.normal(size=wave.shape)
    shown = predicted(p, wanted, 3.0 * rng.normal(size=len(wanted)))
    p = Predictor(machine, p.experiment.with_readings(shown + wave + noise))
    found = infer(p, CandidatePlan(p(), (), ()))
    (plain,) = machines.plain_calibration(p, found).values()
    assert any(u.setup for u in found.columns.unknowns)
    assert not any(u.setup for u in plain.given.sensitivity.unknowns)
    assert not plain.given.rest.factor.size and plain.given.kappa > found.search.best.fit.noise
    off = plain.experiment.reading - plain.prediction
    assert np.nanstd(off[:, :3]) < 0.3 * np.nanstd((p.experiment.reading - p())[:, :3])


@pytest.mark.parametrize("spread", [1e-6, 0.01, 100.0])
def test_numbers_move_as_far_as_their_spread_allows(spread: float) -> None:
    """One zero of a drive off by two uncertainties, read without noise: the posterior mean of a straight line, worked out here."""
    machine = sm.load_machine("orthoglide-revised")
    p = Predictor(machine, random_plan(machine, "position", poses=8, seed=1))
    wanted = [u for u in unknowns(machine.description, p.experiment) if u.group == "zeros"]
    off = np.array([2.0, 0.0, 0.0])
    p = Predictor(machine, p.experiment.with_readings(predicted(p, wanted, off)))
    e, s = p.experiment, sensitivity(p, wanted)
    rows, channel = np.nonzero(e.read)
    n = len(rows)
    rest = Covariance(np.ones(n), np.zeros((n, 0)))
    given = Readings(p, e.sigma, rows, channel, 1.0, np.ones(n), rest, s, np.full(3, spread))
    a = s.columns[rows, channel] / e.sigma[rows, channel][:, None]
    expected = np.linalg.solve(a.T @ a + np.eye(3) / spread**2, a.T @ (a @ off))
    assert corrected(given, ()).numbers == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("zero", "most"), [(0.9e-3, 3e-6), (0.02, 1e-15)])
def test_zeros_of_a_set_up_are_straight_while_they_are_small(zero: float, most: float) -> None:
    machine = sm.load_machine("ur10")
    plan = random_plan(machine, "position", poses=12, seed=1)
    plan = replace(plan, setup=tuple("ab"[int(g) % 2] for g in plan.groups))
    p = Predictor(machine, plan)
    e = p.experiment
    wanted = [u for u in unknowns(machine.description, e) if u.group == "zeros"]
    s = zeros_anew(sensitivity(p, wanted), e)
    values = np.array([zero / u.u * (u.setup == "b") for u in s.unknowns])
    rows, channel = np.nonzero(e.read)
    noise = Covariance(np.ones(len(rows)), np.zeros((len(rows), 0)))
    given = Readings(p, e.sigma, rows, channel, 1.0, np.ones(len(rows)), noise, s, np.ones(len(values)))
    whole, declared = predicted(p, s.unknowns, values), p()
    read = e.read[:, :3]
    off = np.abs(given.predicted(values, ()) - whole)[:, :3][read].max()
    assert off <= most
    assert np.abs(whole - declared)[:, :3][read].max() > 1.5 * zero  # metres of an arm


def test_what_is_far_off_in_rows_that_the_search_did_not_have_is_weighed_down(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The zeros are then those of the other rows, and so are the frames by which poses are predicted."""
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=40, repeats=1, seed=1)
    p = Predictor(machine, replace(plan, frame="unknown"))
    wanted = [u for u in unknowns(machine.description, p.experiment) if u.group == "zeros"]
    rng = np.random.default_rng(0)
    exact = predicted(p, wanted, np.array([1.0, -1.0, 0.5]))
    reading = exact + np.nan_to_num(p.experiment.sigma) * rng.normal(size=exact.shape)
    reading[5, 1] += 6e-4
    p = Predictor(machine, p.experiment.with_readings(reading))
    e, s = p.experiment, sensitivity(p, wanted)
    rows, channel = np.nonzero(e.read)
    n = len(rows)
    rest = Covariance(np.ones(n), np.zeros((n, 0)))
    found = corrected(Readings(p, e.sigma, rows, channel, 1.0, np.ones(n), rest, s, np.ones(3)), ())
    assert found.numbers == pytest.approx([1.0, -1.0, 0.5], abs=0.1)
    left: dict[str, Floats] = {}

    def best(each: dict[str, Floats], wanted: str, *_: object) -> str:
        left.update(each)
        return wanted

    monkeypatch.setattr(machines, "_best", best)
    searched = infer(p, CandidatePlan(p(), (), ()))
    machines.written({"calibrated": found}, p, searched, 0, lambda: False, plain=False)
    others = np.abs(left["calibrated"] / e.sigma)[np.arange(40) != 5]
    assert np.sqrt(np.nanmean(others**2)) < 1.2  # a frame that the row moves would move them all
    weights = found.given.weights
    assert rows[np.argmin(weights)] == 5 and weights.min() < 1e-3 < 0.2 < np.sort(weights)[1]


@pytest.mark.parametrize("far", [2, 12])
def test_what_is_far_off_in_many_rows_is_weighed_no_further(far: int) -> None:
    """Of 40 rows, next to one that the search weighed: two are outliers, twelve are what the machine does not explain."""
    machine = sm.load_machine("orthoglide-revised")
    p = Predictor(machine, random_plan(machine, "position", poses=40, repeats=1, seed=1))
    rng = np.random.default_rng(0)
    more = rng.normal(size=(40, 6))
    more[:far] = 12.0 * np.sign(more[:far])
    p = Predictor(machine, p.experiment.with_readings(p() + np.nan_to_num(p.experiment.sigma) * more))
    e = p.experiment
    rows, channel = np.nonzero(e.read)
    n = len(rows)
    weights = np.where(rows == 39, 0.9, 1.0)
    rest, s = Covariance(1.0 / weights, np.zeros((n, 0))), sensitivity(p, [])
    found = corrected(Readings(p, e.sigma, rows, channel, 1.0, weights, rest, s, np.zeros(0)), ())
    aside = found.given.weights < machines.SET_ASIDE
    assert aside.sum() == (6 if far == 2 else 0) and (aside == (rows < far)).all() == (far == 2)


def test_a_promise_goes_from_the_model_to_what_the_poses_show() -> None:
    few, many = (machines.borne_out((1.0, 0.2), 2.0, n) for n in (0, 100_000))
    assert few[0] == 1.0 and many[0] == pytest.approx(2.0, rel=1e-3)
    size, u = machines.borne_out((1.0, 0.2), 2.0, machines.WORD)
    assert size == pytest.approx(np.sqrt(2.5)) and u == pytest.approx(size / np.sqrt(40.0))
    assert machines.borne_out(None, 2.0, 8) == (2.0, 0.5)


def test_a_turn_that_changes_nothing_is_not_determined() -> None:
    """Of a joint's axis about itself: any angle would do, and none is known to 1e-10."""
    machine = sm.load_machine("ur10")
    p = Predictor(machine, random_plan(machine, "position", poses=12, seed=1))
    kind = registry.get("axis_tilt")
    term = Term(Candidate("axis_tilt", "elbow", ("arm",), kind.parameters), np.zeros(3))
    p = Predictor(machine, p.experiment.with_readings(predicted(p, [], np.zeros(0))))
    e, s = p.experiment, sensitivity(p, [])
    rows, channel = np.nonzero(e.read)
    n = len(rows)
    rest = Covariance(np.ones(n), np.zeros((n, 0)))
    found = corrected(Readings(p, e.sigma, rows, channel, 1.0, np.ones(n), rest, s, np.zeros(0)), (term,))
    (left,) = found.terms
    assert len(left.values) == 2 and np.isfinite(left.sd).all() and not left.undetermined.any()
    assert dict(left.effect(left.values).parameters).keys() < {p.name for p in kind.parameters}


@pytest.mark.parametrize(
    ("kind", "values", "sd", "spare", "why"),
    [
        ("bilinear", (3.0, 1e-5), (0.1, 1e-3), "", "knee"),  # it must be given
        ("bilinear", (3.0, 0.5), (0.1, np.inf), "", "knee"),
        ("bilinear", (10.0, 0.5), (1.0, np.inf), "", "nothing"),
        ("hysteresis", (5.0, 0.0, 1e6), (0.1, np.inf, 1.0), "half_width seat", "half_width"),
        ("zero_offset", (1e9,), (1.0,), "", "error"),
        ("tilt", (1e9, 1.0, 2.0), (1e9, 0.1, 0.1), "angle_x", "angle_x"),
        ("tilt", (1e9, 1.0, 2.0), (1.0, 0.1, 0.1), "", None),  # more than is looked for, and certainly there
        ("tilt", (1e9, 1e9, 1e9), (1.0, 1.0, 1.0), "", "angle_x"),
        (
            "tilt",
            (1e9, 0.1, -0.2),
            (1.0, 0.1, 0.2),
            "",
            "angle_x",
        ),  # the one strength that is there is at its bound
        ("hysteresis", (5.0, 1e9, 3.0), (0.1, 0.1, 0.1), "", None),
        ("tilt", (3.0, 1.0, 2.0), (0.1, 0.1, 0.1), "", None),
    ],
)
def test_an_effect_has_a_name_by_what_is_determined(
    kind: str, values: tuple[float, ...], sd: tuple[float, ...], spare: str, why: str | None
) -> None:
    effect = registry.get(kind)
    p = tuple(q for q in effect.parameters if (q.name in effect.moved if effect.moved else q.fitted))
    start = Term.of(Candidate(kind, "x", (), p), AppliedEffect(kind, "x", (), ()))
    term = replace(start, values=np.clip(np.array(values), *start.bounds), sd=np.array(sd))
    none = np.zeros(0)
    given: Any = None
    refused = Corrected((term,), none, none, none, given).refused
    assert " ".join(np.array([q.name for q in p])[term.spare]) == spare
    assert (refused is None) if why is None else (refused is not None and why in refused[1])


def offset_tool() -> tuple[Corrected, Term]:
    """An arm fitted to readings of a tool far from where it is declared, and the effect before the fit."""
    machine = sm.load_machine("ur10")
    p = Predictor(machine, random_plan(machine, "position", poses=16, seed=1))
    kind = registry.get("tcp_offset")
    element, legs = kind.places(machine.description)[0]
    term = Term(Candidate(kind.kind, element, legs, kind.parameters), np.zeros(3))
    true = Term(term.candidate, np.array([3.0, -2.0, 1.0]))
    shown = p((true.effect(true.values),))
    noise = np.nan_to_num(p.experiment.sigma) * np.random.default_rng(2).normal(size=shown.shape)
    p = Predictor(machine, p.experiment.with_readings(shown + noise))
    e, s = p.experiment, sensitivity(p, [])
    rows, channel = np.nonzero(e.read)
    n = len(rows)
    rest = Covariance(np.ones(n), np.zeros((n, 0)))
    whole = corrected(Readings(p, e.sigma, rows, channel, 1.0, np.ones(n), rest, s, np.zeros(0)), (term,))
    return whole, term


def test_a_fold_is_the_fit_of_its_own_readings() -> None:
    """With the slopes of the whole; a strong effect, and half of the rows, so that the fold lies clearly apart from the whole."""
    whole, term = offset_tool()
    keep = np.arange(len(whole.prediction)) % 2 == 0
    fold, own = without(whole, keep), corrected(whole.given.only(keep), (term,))
    sd = own.terms[0].sd
    np.testing.assert_allclose(fold.terms[0].values, own.terms[0].values, atol=1e-2 * sd.min())
    assert np.abs(fold.terms[0].values - whole.terms[0].values).max() > 0.1 * sd.min()


def test_effects_keep_their_values_where_drives_may_err_along_their_travel() -> None:
    whole, _ = offset_tool()
    more = along_travel(whole, whole.given)
    assert more.terms == whole.terms and more.slopes is whole.slopes
    np.testing.assert_allclose(more.prediction, whole.prediction, atol=1e-12)


@pytest.mark.parametrize(
    ("heavy", "times", "lacks"), [(False, 1.0, False), (True, 1.0, False), (True, 2.5, True)]
)
def test_what_a_machine_leaves_is_compared_with_noise_as_it_is(
    heavy: bool, times: float, lacks: bool
) -> None:
    """Of heavy tails, a thousand readings have squares half as large again as their scale says, and are no lack of fit."""
    rng = np.random.default_rng(4)
    noise = rng.standard_t(machines.DEGREES, (500, 2)) if heavy else rng.normal(size=(500, 2))
    noise[0, 0] = np.nan
    p = machines.lack_of_fit(times * noise, heavy, 3, 1000)
    assert (p < RARE) is lacks and (lacks or p < 0.999)
    assert not heavy or machines.lack_of_fit(noise, False, 3, 1000) < RARE


def test_bounded_squares_of_heavy_tails_have_the_mean_of_squares_of_a_gaussian() -> None:
    rng = np.random.default_rng(5)
    many = 100_000
    for heavy, noise in ((True, rng.standard_t(machines.DEGREES, many)), (False, rng.normal(size=many))):
        assert RARE < machines.lack_of_fit(noise, heavy, 0, many) < 1.0 - RARE

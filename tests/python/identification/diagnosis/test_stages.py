"""Each stage of a diagnosis against cases that can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from math import erfc, log, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from stiffmap.experiment import Experiment
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.folds import folds
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.identification.diagnosis.candidates.sensitivity import Variant
from stiffmap.identification.diagnosis.candidates.stack import Stack
from stiffmap.identification.diagnosis.decision.cross_validation import HeldOut, _gain
from stiffmap.identification.diagnosis.decision.empirical import empirical
from stiffmap.identification.diagnosis.decision.stability import explained, steady
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.rivals import separation as stage
from stiffmap.identification.diagnosis.search.detectability import detectable
from stiffmap.identification.diagnosis.search.screen import Screen, chi2_minus_log_p
from stiffmap.identification.diagnosis.search.significance import effective_number_of_trials, global_p, needed
from stiffmap.model.effects import Parameter


def candidate(name: str, *scales: float) -> Candidate:
    parameters = tuple(Parameter(f"p{i}", "m", -1.0, 1.0, 0.0, s, "") for i, s in enumerate(scales))
    return Candidate("length", name, ("x",), parameters)


def variant(name: str, *columns: Floats, sign: float = 0.0, scale: float = 1e-4) -> Variant:
    """Change of dx by each column (n,)."""
    p = len(columns)
    return Variant(candidate(name, *[scale] * p), np.stack(columns), np.full(p, sign))


def readings_of_dx(values: Floats, **more: Any) -> Experiment:
    """Positions along x from 0 to 1 m with dx read, noise 1 m: readings are their own whitened values."""
    n = len(values)
    reading, sigma = np.full((2, n, 6), np.nan)
    reading[:, 0], sigma[:, 0] = values, 1.0
    position = np.zeros((n, 3))
    position[:, 0] = np.linspace(0.0, 1.0, n)
    ids = tuple(map(str, range(n)))
    return Experiment("hand", "none", "position", ids, position, np.zeros((n, 6)), reading, sigma, **more)


def problem_of(values: Floats) -> Problem:
    e = readings_of_dx(values)
    return Problem.of(e, e.sigma, np.zeros((len(e), 6)))


E = np.eye(5)
DATA = 3 * E[0] + 4 * E[1]


def screen() -> Screen:
    both, back = variant("both", E[0], 2 * E[1]), variant("back", -E[1], sign=1.0)
    blind = variant("blind", 0 * E[0])
    return Screen.of(problem_of(DATA), Stack.of([variant("one", 2 * E[0]), both, back, blind]))


def test_screen_takes_away_the_squared_projection() -> None:
    """Residual (3, 4): 9 along the first axis, 25 in their plane; -e2 may only grow, but would have to shrink."""
    s = screen()
    assert s.rank.tolist() == [1, 2, 1, 0]
    assert s.delta_chi2(DATA[:, None])[:, 0] == pytest.approx([9.0, 25.0, 0.0, 0.0])
    assert s.estimate(0, DATA) == pytest.approx([1.5])
    assert s.estimate(1, DATA) == pytest.approx([3.0, 2.0])


def test_screen_counts_a_reduction_by_its_freedom() -> None:
    """One parameter: p = erfc(3/√2). Two: p = exp(-25/2)."""
    s = screen()
    found = s.minus_log_p(s.delta_chi2(DATA[:, None])[:, 0])
    assert found[:2] == pytest.approx([-log(erfc(3 / sqrt(2))), 12.5])
    assert chi2_minus_log_p(np.array(4000.0), np.array(2)) == pytest.approx(
        2000.0
    )  # p is below the smallest double


def test_screen_beside_a_model_sees_what_the_model_leaves() -> None:
    s = screen().beside(E[:, :1])
    assert s.rank.tolist() == [0, 1, 1, 0]
    assert s.delta_chi2((4 * E[1])[:, None])[:, 0] == pytest.approx([0.0, 16.0, 0.0, 0.0])


def test_screen_beside_a_model_is_a_projection() -> None:
    """Against columns that are projected and orthonormalised one variant at a time."""
    rng = np.random.default_rng(3)
    data = rng.standard_normal(40)
    columns = [rng.standard_normal((40, p)) for p in (1, 2, 3, 2)]
    columns[3][:, 1] = columns[3][:, 0]
    tangent = np.linalg.qr(np.column_stack([columns[1][:, 0], rng.standard_normal(40)]))[0]
    s = Screen.of(problem_of(data), Stack.of([variant(f"v{i}", *c.T) for i, c in enumerate(columns)]))
    s = s.beside(tangent)
    left = data - tangent @ (tangent.T @ data)
    found = s.delta_chi2(left[:, None])[:, 0]
    for i, c in enumerate(columns):
        rest = c - tangent @ (tangent.T @ c)
        u, size, _ = np.linalg.svd(rest, full_matrices=False)
        q = u[:, size > 1e-8]
        assert s.rank[i] == q.shape[1]
        assert found[i] == pytest.approx(float(np.sum((q.T @ left) ** 2)), rel=1e-9)
        b = s.basis(i)
        assert b.T @ b == pytest.approx(np.eye(q.shape[1]), abs=1e-9)
        assert b @ b.T == pytest.approx(q @ q.T, abs=1e-9)


@pytest.mark.parametrize("number", [1, 8])
def test_significance_counts_independent_tests(number: int) -> None:
    """The least of k uniform p-values has the median 1 - 2^(-1/k), and M = ln 2 over it."""
    axes = np.eye(12)
    s = Screen.of(problem_of(np.zeros(12)), Stack.of([variant(f"v{i}", axes[i]) for i in range(number)]))
    wanted = log(2.0) / (1 - 2 ** (-1 / number))
    assert effective_number_of_trials(s, seed=1, draws=20000) == pytest.approx(wanted, rel=0.05)


def test_significance_counts_the_same_signature_once() -> None:
    same = [variant(f"v{i}", (i + 1.0) * E[0]) for i in range(8)]
    s = Screen.of(problem_of(np.zeros(5)), Stack.of(same))
    assert effective_number_of_trials(s, seed=1, draws=20000) == pytest.approx(2 * log(2.0), rel=0.05)


def test_the_threshold_is_where_the_false_alarm_rate_is_alpha() -> None:
    threshold = needed(50.0, alpha=1e-4)
    assert global_p(threshold, 50.0) == pytest.approx(1e-4, rel=1e-12)
    assert threshold == pytest.approx(log(50.0 / 1e-4), rel=1e-4)


def fit_of_halves(low: float, high: float, n: int = 400) -> tuple[Problem, Model]:
    """dx is `low` in one half of the workspace and `high` in the other; the effect shifts all readings alike."""
    values = np.where(np.arange(n) < n // 2, low, high)
    problem, value = problem_of(values), (low + high) / 2
    r, column = values - value, np.ones((n, 1))
    return problem, Model((candidate("v", 1.0),), np.array([value]), float(r @ r), -column, r)


def test_stability_asks_whether_halves_agree() -> None:
    """The value 1 becomes 1 ± 0.3, then 1 ± 0.6; 0.35 and three standard deviations of 200 readings are allowed."""
    assert 3 / sqrt(200) + 0.35 == pytest.approx(0.562, abs=1e-3)
    assert steady(*fit_of_halves(0.7, 1.3)) == [True]
    assert steady(*fit_of_halves(0.4, 1.6)) == [False]


def test_stability_measures_what_is_explained() -> None:
    """Chi-square 1100 of 100 readings: 1000 beyond noise, of which 900 go."""
    assert explained(Model(chi2=1100.0), Model(chi2=200.0), 100) == pytest.approx(0.9)
    assert explained(Model(chi2=90.0), Model(chi2=80.0), 100) == 1.0


def test_detection_is_the_power_of_the_threshold() -> None:
    """One parameter of whitened length 4 per 0.1 mm: found with 95 % power at (√critical + 1.645)/4 scales, as the
    other tail counts for nothing; critical 5² belongs to -ln p of 5 standard deviations."""
    s = Screen.of(
        problem_of(np.zeros(5)), Stack.of([variant("seen", 4 * E[0]), variant("faint", 1e-3 * E[1])])
    )
    seen, faint = detectable(s, -log(erfc(5 / sqrt(2))))
    size = seen.sizes["p0"]
    assert size == pytest.approx((5 + norm.isf(0.05)) / 4 * 1e-4, rel=1e-6)
    assert faint.sizes["p0"] is None  # changes no reading by as much as counts at all
    beyond = Screen.of(problem_of(np.zeros(5)), Stack.of([variant("bound", 2 * E[1], scale=1.0)]))
    assert (
        detectable(beyond, 12.0)[0].sizes["p0"] is None
    )  # (5 + 1.6)/2 m and more: larger than the parameter's bound


def test_cross_validation_weighs_gain_against_its_error() -> None:
    """Squares fall from 4 to 1 in one fold and from 4 to 3 in the other: 2 ± 1, which pays; not where one gets worse."""
    label = np.array([0, 0, 1, 1])
    before, after = np.full((4, 1), 2.0), np.sqrt(np.array([[1.0], [1.0], [3.0], [3.0]]))
    assert _gain(before, after, label) == pytest.approx((2.0, 1.0))
    summary: Any = None
    held = HeldOut(summary, summary, np.zeros((0, 6)), {"length of bar": 3}, 5, "poses", gain=(2.0, 1.0))
    assert held.pays
    assert not replace(held, gain=(0.5, 1.0)).pays
    assert held.shared("length of bar")
    assert not replace(held, chosen={"length of bar": 2}).shared("length of bar")


def test_cross_validation_holds_out_whole_set_ups() -> None:
    label, by = folds(readings_of_dx(np.zeros(6), setup=("a", "a", "b", "b", "a", "c")), seed=0)
    assert (label.tolist(), by) == ([0, 0, 1, 1, 0, 2], "set-ups")
    label, by = folds(readings_of_dx(np.zeros(10)), seed=0)
    assert by == "poses"
    assert sorted(np.bincount(label)) == [2] * 5


def test_an_empirical_field_predicts_what_is_smooth_and_no_noise() -> None:
    x = np.linspace(0.0, 1.0, 80)
    e = readings_of_dx(np.zeros(80))
    smooth = np.full((80, 6), np.nan)
    smooth[:, 0] = 50 * np.sin(2 * x)
    found = empirical(e, smooth, e.sigma, seed=1)
    assert found is not None
    assert found.before == pytest.approx(50 * sqrt(np.mean(np.sin(2 * x) ** 2)))
    assert found.after < 0.05 * found.before
    noise = np.full((80, 6), np.nan)
    noise[:, 0] = np.random.default_rng(2).standard_normal(80)
    nothing = empirical(e, noise, e.sigma, seed=1)
    assert nothing is not None
    assert nothing.after > 0.9 * nothing.before


def test_separation_reads_where_two_explanations_differ_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """They differ by x² in dx: furthest at the end of the workspace, x = 2. With a noise of 16 that is a quarter of a
    standard deviation, and five need (5/0.25)² = 400 readings."""

    class Fake:
        def __init__(self, machine: Any, plan: Experiment, threads: int | None) -> None:
            self.plan = plan

        def __call__(self, terms: Any) -> Floats:
            out = np.zeros((len(self.plan), 6))
            out[:, 0] = self.plan.position[:, 0] ** 2 if terms else 0.0
            return out

    monkeypatch.setattr(stage, "Predictor", Fake)
    e = readings_of_dx(np.zeros(4))
    box = ((0.0, 0.0, 0.0), (2.0, 1.0, 1.0))
    study: Any = SimpleNamespace(
        experiment=e,
        description=SimpleNamespace(workspace=box),
        predictor=SimpleNamespace(machine=None, threads=None),
        noise=SimpleNamespace(floor=np.array([16.0, *[np.nan] * 5])),
    )
    one = Model((candidate("v", 1.0),), np.zeros(1))
    found = stage.separation(study, one, Model(), seed=0)
    assert found.axis == "dx"
    assert found.position[0] == pytest.approx(2.0 * 0.98 + 0.02 * 0.5 * 2.0)  # just inside the corner
    wanted = 5.0 / (found.position[0] ** 2 / 16.0)
    assert found.readings == int(np.ceil(wanted**2))
    assert abs(found.readings - 400) < 20
    assert found.difference == pytest.approx(found.position[0] ** 2)

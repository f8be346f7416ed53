"""What a search for causes of a tap test hands on, and which set of them counts; numbers worked by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.python.identification.taps.test_taps import EXAMPLE, soft, tapped

import stiffmap as sm
from stiffmap.identification.inference.optimum import Optimum
from stiffmap.identification.taps import fit as search
from stiffmap.identification.taps.fit import FittedCauses, best_of, fitted
from stiffmap.identification.taps.problem import TapsProblem, causes


def fit(chi2, count, readings=20):
    none = np.zeros((readings, 0))
    return FittedCauses(
        (None,) * count, chi2, None, Optimum(np.zeros(0), none[:, 0:1].sum(axis=1), none), none
    )


@pytest.mark.parametrize(
    ("chi2", "places", "causes_"),
    [
        ([30.0, 18.0, 16.0], 10, 1),  # 2 ln(20 * 10) = 10.6: 30, 28.6, 37.2
        ([30.0, 18.0, 16.0], 40, 0),  # 2 ln(20 * 40) = 13.4: 30, 31.4, 42.7
        ([90.0, 60.0, 20.0], 10, 2),  # 90, 70.6, 41.2
        ([300.0, 200.0], 10, 0),  # ten times the noise: 300, 306
        ([300.0, 190.0], 10, 1),  # 9.5 times: 300, 290.7
    ],
)
def test_a_cause_must_be_worth_its_odds_at_any_place(chi2, places, causes_):
    fits = [fit(c, k) for k, c in enumerate(chi2)]
    assert best_of(fits, places) is fits[causes_]


@pytest.fixture(scope="module")
def problem():
    arm = sm.load_machine(EXAMPLE / "kr210.yaml")
    return TapsProblem(arm, tapped(soft(arm), 5), None, 0.05)


def cause(problem, name):
    return next(c for c in causes(problem) if str(c) == f"compliance of {name}, leg arm")


def test_what_is_searched_next_is_free_of_the_causes_of_a_fit(problem):
    """These move with further ones: what they could show is taken out of all columns, and only that."""
    tried = [cause(problem, name) for name in ("a1", "a2", "a3")]
    at = fitted(problem, [(tried[1], 1.8)])
    columns = search.columns_of(problem, tried, at)
    assert len(columns) == len(at.own) - 1 and [p.candidate for p in columns.places] == [tried[0], tried[2]]
    assert np.abs(columns.free.T @ at.own).max() < 1e-9 * np.abs(at.own).max()


def test_sets_are_all_causes_and_some_with_those_of_the_fit_and_without(problem, monkeypatch):
    one, two, three, four = (cause(problem, name) for name in ("a1", "a2", "a3", "a4"))

    def chosen(c, value):
        return SimpleNamespace(place=SimpleNamespace(candidate=c), strengths=((c.parameters[0], value),))

    found = [
        SimpleNamespace(chosen=chosen(one, 2.0), equivalents=(four,)),
        SimpleNamespace(chosen=chosen(two, 3.0), equivalents=()),
    ]
    best = SimpleNamespace(best=SimpleNamespace(fit=None))
    monkeypatch.setattr(search, "searched", lambda columns, predict: best)
    monkeypatch.setattr(search, "put_instead", lambda fit_, c, place: chosen(place, 4.0))
    monkeypatch.setattr(search, "judged", lambda columns, found_: SimpleNamespace(named=found))
    at = fitted(problem, [(three, 1.1)])
    sets = [{str(c): v for c, v in s} for s in search.named_causes(problem, [one, two], at)]
    given = {str(three): at.named[0].value}
    a, b, instead_of_a = {str(one): 2.0}, {str(two): 3.0}, {str(four): 4.0}
    alone = [a, b, a | b, instead_of_a, instead_of_a | b]
    assert len(sets) == 10 and all(s in sets for s in (*alone, *(given | s for s in alone)))

"""Each stage of a diagnosis against cases that can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.diagnosis.report import separation as stage
from stiffmap.identification.diagnosis.slips.find import Screen
from stiffmap.model import effects
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


def problem_of(values: Floats) -> LinearProblem:
    e = readings_of_dx(values)
    return LinearProblem.of(e, e.sigma, np.zeros((len(e), 6)))


E = np.eye(5)
DATA = 3 * E[0] + 4 * E[1]


def gain(*variants: Variant, of: Floats = DATA) -> float:
    return Screen.of(problem_of(DATA), variants).gain(of)


def test_the_best_part_takes_away_the_squared_projection() -> None:
    """Residual (3, 4): 9 along the first axis, 25 in their plane; -e2 may only grow, but would have to shrink."""
    one, both = variant("one", 2 * E[0]), variant("both", E[0], 2 * E[1])
    back, blind = variant("back", -E[1], sign=1.0), variant("blind", 0 * E[0])
    assert gain(one) == pytest.approx(9.0)
    assert gain(both, one) == gain(one, both) == pytest.approx(25.0)
    assert gain(back) == gain(blind) == gain() == 0.0
    assert gain(back, of=-DATA) == pytest.approx(16.0)
    assert gain(one, back, blind) == pytest.approx(9.0)


def test_a_part_that_would_have_to_be_larger_than_it_can_is_none() -> None:
    """The second axis needs 0.4 scales, 40 µm, of one that may be 1 m or 35 µm; half of it is within both."""
    wide, narrow = variant("wide", E[1]), variant("narrow", 10 * E[1])
    assert gain(wide) == gain(narrow) == pytest.approx(16.0)
    short = tuple(replace(p, lower=-3.5e-5, upper=3.5e-5) for p in narrow.candidate.linear)
    bounded = replace(narrow, candidate=replace(narrow.candidate, parameters=short))
    assert gain(bounded) == 0.0 and gain(bounded, variant("one", E[0])) == pytest.approx(9.0)
    assert gain(bounded, of=0.5 * DATA) == pytest.approx(4.0)


def test_the_best_two_parts_leave_what_neither_explains() -> None:
    """Of (3, 4, 2): the first two axes leave 4; where the second may not be large enough, the first and the third leave 16."""
    of, parts = DATA + 2 * E[2], [variant(str(k), E[k]) for k in range(3)]
    assert Screen.of(problem_of(DATA), parts).left_by_two(of) == pytest.approx(4.0)
    short = tuple(replace(p, lower=-3.5e-4, upper=3.5e-4) for p in parts[1].candidate.linear)
    parts[1] = replace(parts[1], candidate=replace(parts[1].candidate, parameters=short))
    assert Screen.of(problem_of(DATA), parts).left_by_two(of) == pytest.approx(16.0)
    assert Screen.of(problem_of(DATA), []).left_by_two(of) == pytest.approx(29.0)


def test_what_a_measurement_does_is_no_part_of_the_machine() -> None:
    kind = next(k for k in effects.kinds() if effects.get(k).measurement)
    v = variant("one", E[0])
    assert gain(replace(v, candidate=replace(v.candidate, kind=kind))) == 0.0


def test_separation_reads_where_two_explanations_differ_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """They differ by x² in dx: furthest at the end of the workspace, x = 2. With a noise of 16 that is a quarter of a
    standard deviation, and five need (5/0.25)² = 400 readings."""

    e = readings_of_dx(np.zeros(4))
    box = ((0.0, 0.0, 0.0), (2.0, 1.0, 1.0))
    orthoglide = sm.load_machine("orthoglide-revised")
    machine = sm.Machine(replace(orthoglide.description, workspace=box), like=orthoglide)

    class Fake:
        def __init__(self, machine: Any, plan: Experiment, threads: int | None = None) -> None:
            self.machine, self.experiment, self.threads = machine, plan, threads

        def __call__(self, terms: Any) -> Floats:
            out = np.zeros((len(self.experiment), 6))
            out[:, 0] = self.experiment.position[:, 0] ** 2 if terms else 0.0
            return out

    monkeypatch.setattr(stage, "Predictor", Fake)
    one: Any = [object()]
    found = stage.separation(Fake(machine, e), np.array([16.0, *[np.nan] * 5]), one, (), seed=0)  # type: ignore[arg-type]
    assert found.axis == "dx"
    assert found.position[0] == pytest.approx(2.0 * 0.98 + 0.02 * 0.5 * 2.0)  # just inside the corner
    wanted = 5.0 / (found.position[0] ** 2 / 16.0)
    assert found.readings == int(np.ceil(wanted**2))
    assert abs(found.readings - 400) < 20
    assert found.difference == pytest.approx(found.position[0] ** 2)

"""Each stage of a diagnosis against cases that can be worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stiffmap.experiment import Experiment
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.candidates.stack import Stack
from stiffmap.identification.diagnosis.report import separation as stage
from stiffmap.identification.diagnosis.slips.screen import Screen
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


def test_separation_reads_where_two_explanations_differ_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """They differ by x² in dx: furthest at the end of the workspace, x = 2. With a noise of 16 that is a quarter of a
    standard deviation, and five need (5/0.25)² = 400 readings."""

    e = readings_of_dx(np.zeros(4))
    box = ((0.0, 0.0, 0.0), (2.0, 1.0, 1.0))
    machine: Any = SimpleNamespace(description=SimpleNamespace(workspace=box))

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

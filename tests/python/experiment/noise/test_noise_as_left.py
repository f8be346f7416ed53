"""Noise other than declared is said, and intervals go with it."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.experiment import Experiment
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.as_left import as_left
from stiffmap.experiment.noise.whitening import Problem


def problem(values: Floats) -> Problem:
    """(n, 2) readings of dx and dy in the order of time, noise 1 m."""
    n = len(values)
    reading, sigma = np.full((2, n, 6), np.nan)
    reading[:, :2], sigma[:, :2] = values, 1.0
    position = np.zeros((n, 3))
    position[:, 0] = np.linspace(0.0, 1.0, n)
    e = Experiment(
        "hand", "none", "position", tuple(map(str, range(n))), position, np.zeros((n, 6)), reading, sigma,
        order=np.arange(n, dtype=float),
    )  # fmt: skip
    return Problem.of(e, sigma, np.zeros((n, 6)))


def left(values: Floats) -> tuple[Problem, Floats]:
    p = problem(values)
    return p, p.residual(np.zeros((len(values), 6)))


def test_noise_as_declared_is_not_spoken_of() -> None:
    rng = np.random.default_rng(0)
    said = [as_left(*left(rng.standard_normal((150, 2))), 0) for _ in range(60)]
    assert not any(s.sentences() for s in said)
    assert {s.widening for s in said} == {1.0}


@pytest.mark.parametrize(
    ("factor", "words"), [(2.0, "leaves 2 times the declared noise"), (0.5, "declared noise is 2 times")]
)
def test_half_and_double(factor: float, words: str) -> None:
    z = np.random.default_rng(1).standard_normal((400, 2))
    found = as_left(*left(factor * z / z.std()), 0)
    assert words in found.sentences()[0]
    assert found.widening == pytest.approx(factor, rel=0.01)


def test_correlation_along_time_widens_by_the_number_that_rows_are_worth() -> None:
    """AR(1): the variance of a mean is (1 + r) / (1 - r) times that of independent readings."""
    rng = np.random.default_rng(2)
    z = np.zeros((3000, 2))
    for i in range(1, len(z)):
        z[i] = 0.6 * z[i - 1] + 0.8 * rng.standard_normal(2)
    found = as_left(*left(z), 0)
    assert found.along_time == pytest.approx(0.6, abs=0.04)
    assert found.widening == pytest.approx(2.0, rel=0.1)
    assert "correlated along time" in " ".join(found.sentences())


def test_heavy_tails_are_said() -> None:
    z = np.random.default_rng(3).standard_t(3, (400, 2))
    assert "heavier tails" in as_left(*left(z / z.std()), 0).sentences()[-1]

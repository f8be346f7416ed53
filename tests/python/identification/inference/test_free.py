"""Directions that unknown frames leave free, against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.experiment.noise.whitening import basis
from stiffmap.identification.inference.columns import Free


@pytest.mark.parametrize("taken", [0, 1, 6, 11])
@pytest.mark.parametrize("repeats", [False, True])
def test_directions_noise_and_information(taken: int, repeats: bool) -> None:
    rng = np.random.default_rng(taken)
    number = rng.permutation(np.append(np.arange(12), rng.integers(12, size=9 if repeats else 0)))
    mean = np.zeros((len(number), 12))
    mean[np.arange(len(number)), number] = 1.0 / np.sqrt(np.bincount(number))[number]
    q = basis(rng.normal(size=(12, taken)))
    free = Free.across(q, mean)
    b = free.matrix
    assert b.shape == (len(number), 12 - taken)
    np.testing.assert_allclose(b.T @ b, np.eye(12 - taken), atol=1e-14)
    np.testing.assert_allclose((mean @ q).T @ b, 0.0, atol=1e-14)
    variance = rng.uniform(0.1, 5.0, len(number))
    np.testing.assert_allclose(free.of_noise(variance), b.T @ np.diag(variance) @ b, atol=1e-13)
    half = rng.normal(size=(12 - taken, 12 - taken))
    information = half @ half.T
    found = free.at_readings(np.asfortranarray(np.tril(information)))
    np.testing.assert_allclose(found, np.diag(b @ information @ b.T), atol=1e-13)


def test_taken_directions_that_are_readings_themselves() -> None:
    """The first q averages: nothing is left to turn; and all others, whose first q rows are zero."""
    for q in (np.eye(5)[:, :2], np.eye(5)[:, 3:], -np.eye(5)[:, :2]):
        b = Free.across(q, np.eye(5)).matrix
        np.testing.assert_allclose(b.T @ b, np.eye(3), atol=1e-14)
        np.testing.assert_allclose(q.T @ b, 0.0, atol=1e-14)

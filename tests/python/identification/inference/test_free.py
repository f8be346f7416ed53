"""Directions that unknown frames leave free."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.experiment.noise.whitening import basis
from stiffmap.identification.inference.columns import across


@pytest.mark.parametrize("taken", [0, 1, 6, 11, 12])
def test_what_is_left_is_orthonormal_and_across_what_is_taken(taken: int) -> None:
    for q in (basis(np.random.default_rng(taken).normal(size=(12, taken))), -np.eye(12)[:, 12 - taken :]):
        b = across(q)
        assert b.shape == (12, 12 - taken)
        np.testing.assert_allclose(b.T @ b, np.eye(12 - taken), atol=1e-14)
        np.testing.assert_allclose(q.T @ b, 0.0, atol=1e-14)

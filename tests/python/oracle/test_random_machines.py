"""Random machines: the core agrees with energy minimisation, by both paths."""

from __future__ import annotations

import pytest

import stiffmap as sm

from .compare import compare


@pytest.mark.parametrize("seed", range(4))
def test_core_agrees_with_energy_minimisation(seed: int) -> None:
    for c in compare(seed):
        assert c.status == sm.Status.CONVERGED
        assert c.translation < 1e-8
        assert c.rotation < 1e-8
        assert c.compliance < 1e-8

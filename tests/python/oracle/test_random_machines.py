"""Random machines: the core agrees with energy minimisation, by both paths."""

from __future__ import annotations

import pytest

from .compare import compare
from .nightly import agrees


@pytest.mark.parametrize("seed", range(12))
def test_core_agrees_with_energy_minimisation(seed: int) -> None:
    for c in compare(seed):
        assert agrees(c), c

"""Laws with corners on every single direction of every link spring, coupled ones too, in the kernels (docs/fast_path.md F5)."""

from __future__ import annotations

import pytest
from tests.oracle.with_effects import with_effect
from tests.python.solve.compiled.agreement import LOADS, TOLERANCE, draw, gap

import stiffmap as sm


@pytest.mark.parametrize("kind", ["tabulated", "bilinear", "friction"])
@pytest.mark.parametrize("name", LOADS)
def test_agreement(name: str, kind: str) -> None:
    machine, _ = with_effect(sm.load_machine(name), kind)
    assert machine is not None
    assert machine.fast == ""
    position, wrench = draw(machine, 16, seed=41)
    found = gap(machine, position, wrench, gravity=(0.0, 0.0, -9.81))
    assert found.statuses == 0
    assert found.poses > 8
    assert found.worst() < TOLERANCE


@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "hexapod"])
def test_share(name: str) -> None:
    machine, _ = with_effect(sm.load_machine(name), "tabulated")
    assert machine is not None
    assert machine.solve(*draw(machine, 64, seed=42)).reference_share == 0


def test_stuck_directions_stay_with_the_reference() -> None:
    machine = sm.load_machine("orthoglide-revised").with_effect(
        "friction", element="bar.k11", force=20.0, branch="loading_stuck"
    )
    assert "stuck" in machine.fast

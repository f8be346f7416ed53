"""Every effect that finds a place on a shipped machine can be added there, saved and solved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.effects import get, kinds

NEW = (
    *("hexapod", "linear-delta", "rotary-delta", "hybrid", "ur10", "five-bar", "swing-table", "3-rps"),
    "travelling-column",
)

ASKS = (
    "bilinear",
    "periodic_error",
    "straightness",
    "tabulated",
    "external_spring",
)  # for a number that only the caller knows


def small(machine: sm.Machine, kind: str, element: str, legs: tuple[str, ...]) -> dict[str, float]:
    """A small value of each parameter that a caller has to give; one of those that exclude each other."""
    effect = get(kind)
    given = effect.parameters_at(machine.description, element, legs)
    names = [p for p in given if p.fitted and p.null is not None]
    first = next((p.name for p in names if p.name in effect.one_of), "")
    names = [p for p in names if p.name == first or p.name not in effect.one_of]
    return {p.name: (p.null or 0.0) + 0.1 * p.scale for p in names}


@pytest.mark.parametrize("name", NEW)
def test_effects(name: str, tmp_path: Path) -> None:
    machine = sm.load_machine(name)
    p = machine.description.home.p + [0.01, 0, 0]
    wrench = [5, 0, -5, 0, 0, 0]
    changed = set()
    before = machine.solve(p, wrench, gravity=[0, 0, -9.81]).displacement
    for kind in kinds():
        effect = get(kind)
        places = [] if effect.measurement else effect.places(machine.description)
        if not places or effect.needs:
            continue
        element, legs = places[0]
        if kind in ASKS:
            with pytest.raises(sm.StiffmapError, match="is missing"):
                machine.with_effect(
                    kind, element=element, legs=list(legs), **small(machine, kind, element, legs)
                )
            continue
        other = machine.with_effect(
            kind, element=element, legs=list(legs), **small(machine, kind, element, legs)
        )
        s = other.solve(p, wrench, gravity=[0, 0, -9.81])
        assert s.ok, f"{kind} of {element}: {sm.Status(int(s.status)).name}"
        if np.abs(s.displacement - before).max() > 1e-12:
            changed.add(kind)
        other.save(tmp_path / "m.yaml")
        assert sm.load_machine(tmp_path / "m.yaml") == other
    assert len(changed) >= 5, changed

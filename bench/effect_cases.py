"""Machines with an effect on every element that a diagnosis would suspect of it (tests/oracle/with_effects.py)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.oracle.with_effects import with_effect

import stiffmap as sm
from stiffmap.model.effects import get, kinds


def machines_with_effects(machine: sm.Machine) -> Iterator[tuple[str, sm.Machine]]:
    """Kind and machine, for each kind that some element takes; elements that refuse it are printed."""
    for kind in kinds():
        effect = get(kind)
        if effect.apply is None:
            continue
        changed, refused = with_effect(machine, kind, (effect.tried or effect.places)(machine.description))
        for why in refused:
            print(f"refused: {machine.name} {kind}: {why}", file=sys.stderr, flush=True)
        if changed is not None:
            yield kind, changed

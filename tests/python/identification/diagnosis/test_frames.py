"""An instrument whose frame nobody knows: effects, outliers and held-out readings beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate


def test_held_out_readings_are_free_of_the_unknown_frame() -> None:
    """Millimetres of an unknown frame neither hide 0.1 mm of a bar nor count as error or outliers."""
    declared = sm.load_machine("orthoglide-revised")
    plan = random_plan(declared, "position", poses=40, seed=3)
    worn = declared.with_effect("length", element="bar", legs=["x"], error=1e-4)
    twin = simulate(worn, plan, [], seed=5)
    moved = twin.reading.copy()
    moved[:, :3] += np.array([2e-3, -1e-3, 5e-4]) + np.cross([1e-3, -2e-3, 1e-3], twin.position)
    d = sm.diagnose(declared, replace(twin, reading=moved, frame="unknown"))
    named = [*d.effects, *(e for a in d.alternatives for e in a)]
    places = {(e.kind, e.element) for e in named} | {
        (a["kind"], a["element"]) for e in named for a in e.aliases
    }
    assert ("length", "bar") in places
    assert d.outliers == []
    assert 0.8 < d.after.ratio < 1.2 < d.before.ratio

"""Pieces of a diagnosis on made-up numbers: rivals, intervals, places of what is left."""

from __future__ import annotations

import stiffmap as sm
from stiffmap.experiment import random_plan
from stiffmap.identification.candidates.candidates import candidates


def test_gain_of_all_axes_stands_apart() -> None:
    machine = sm.load_machine("orthoglide-revised")
    deflections = random_plan(machine, "deflection", poses=2, loads=3)
    gains = [c for c in candidates(machine.description, deflections) if c.kind == "load_gain"]
    assert sorted(len(c.parameters) for c in gains) == [1, 3]

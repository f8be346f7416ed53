"""From what the inference found to an answer: effects that a machine cannot have end nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.identification.candidates.candidates import candidates
from stiffmap.identification.diagnosis.answer import _change
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.sentences import next_step
from stiffmap.identification.diagnosis.report.separation import Separation
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.names import terms


@pytest.mark.parametrize(("slope", "there"), [(0.5, True), (40.0, False)])
def test_an_effect_that_the_machine_cannot_have_adds_nothing(slope: float, there: bool) -> None:
    machine = sm.load_machine("hexapod")
    p = Predictor(machine, random_plan(machine, "deflection", poses=6, loads=4, seed=1))
    candidate = next(
        c
        for c in candidates(machine.description, p.experiment)
        if c.kind == "position_dependent_compliance" and c.legs == ("3",)
    )
    variant: Any = SimpleNamespace(shape=(), start=None)
    place: Any = SimpleNamespace(candidate=candidate, shapes=[SimpleNamespace(variant=variant)])
    part: Any = None
    c = Chosen(place, 0, part, np.array([slope / candidate.linear[0].scale]))
    if not there:
        with pytest.raises(sm.StiffmapError):
            p(terms([c]))
    assert bool(np.abs(_change(p, c)).max() > 0.0) is there


@pytest.mark.parametrize(
    ("kind", "element", "which", "readings", "words"),
    [
        ("sensor_gain", "sensor", "corrected", (), "no fault of the machine"),
        ("compliance", "actuator", "calibrated", (), "numbers adjusted in its stead"),
        ("compliance", "actuator", "corrected", (603, None), "no reading that this machine can show"),
        ("compliance", "actuator", "corrected", (None, 20), "decides: read dx"),
    ],
)
def test_the_next_step_is_one_that_a_workshop_can_take(
    kind: str, element: str, which: str, readings: tuple[int | None, ...], words: str
) -> None:
    """A faulty gauge is not mended at the machine, and no one reads six hundred times what a whole experiment did not show."""
    found = SimpleNamespace(
        slips=[],
        verdict="ambiguous" if readings else "effects",
        effects=[Effect(kind, element, (), {}, [{"kind": kind}], {})],
        alternatives=list(readings),
        separations=[Separation((0, 0, 0), (0, 0, 0), "dx", 1e-4, n) for n in readings],
        before=SimpleNamespace(n=252),
        which=which,
    )
    assert words in next_step(found)

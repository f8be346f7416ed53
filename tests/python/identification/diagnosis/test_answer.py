"""From what the inference found to an answer: effects that a machine cannot have end nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.identification.candidates.candidates import candidates
from stiffmap.identification.diagnosis import answer
from stiffmap.identification.diagnosis.answer import _change, _rest
from stiffmap.identification.diagnosis.report.findings import Effect, effects_of
from stiffmap.identification.diagnosis.report.sentences import next_step, opening
from stiffmap.identification.diagnosis.report.separation import Separation
from stiffmap.identification.inference.chosen import Chosen, Term
from stiffmap.identification.inference.kernels import WANDER
from stiffmap.identification.inference.machines import written
from stiffmap.identification.inference.places import Place
from stiffmap.identification.inference.verdict import NOISIER

DATA = Path(__file__).parents[3] / "data/experiments"


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
            p([c.term])
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


@pytest.mark.parametrize(
    ("rms", "scale", "what", "words", "then"),
    [
        (
            2e-5,
            1.0,
            "",
            "within what these readings can show (20.0 µm rms, noise 10.0 µm); it goes on",
            "Check the instrument",
        ),
        (1e-5, 1.0, "", "noise 10.0 µm).", "Keep the readings"),
        (4e-5, 4.0, "", "; it goes on", "Check the instrument"),
        (4e-5, 4.0, "noise larger than declared", "scatter 4 times as much as is stated", "State the noise"),
        (4e-5, 4.0, "a field", "no single cause", "Look at where"),
        (
            4e-5,
            1.0,
            f"{WANDER} over 1 session",
            "goes on from row to row over time",
            "Let machine and instrument warm up",
        ),
    ],
)
def test_the_first_line_says_why_readings_differ_from_a_machine_that_is_as_declared(
    rms: float, scale: float, what: str, words: str, then: str
) -> None:
    found = SimpleNamespace(
        slips=[],
        verdict="unattributed" if what else "none",
        effects=[],
        calibration=None,
        stopped=False,
        unexplained=[SimpleNamespace(what=what)] if what else [],
        limitations=["it goes on"],
        before=SimpleNamespace(size=(rms, "m"), n=100),
        noise=SimpleNamespace(scale=scale),
        noise_size=1e-5 * scale,
    )
    assert words in opening(found) and next_step(found).startswith(
        (then, "Nothing to correct. " + then, "Nothing to correct at the machine. " + then)
    )


@pytest.mark.parametrize("kind", ["field", "pose", "time"])
def test_noise_beyond_its_declaration_has_the_share_of_what_is_not_demanded_and_no_place(kind: str) -> None:
    part: Any = SimpleNamespace(name="short", kind=kind)
    fit: Any = SimpleNamespace(parts=(part, SimpleNamespace(name="tool", kind="effect")))
    v: Any = SimpleNamespace(rest=NOISIER)
    columns: Any = SimpleNamespace(experiment=None)
    (rest,) = _rest(columns, fit, v, {"noise": 0.5, "short": 0.2, "tool": 0.3}, np.full((4, 6), 1e-9))
    assert (rest.what, rest.axis, rest.position) == (NOISIER, "", None)
    assert rest.share == pytest.approx(0.7)


@pytest.mark.parametrize("kind", ["sensor_gain", "load_gain", "compliance"])
def test_an_effect_is_no_alias_of_itself_at_its_own_place(kind: str) -> None:
    """A gain of all axes and one for each show alike where one axis is read."""
    machine = sm.load_machine("five-bar")
    e = random_plan(machine, "deflection", poses=6, loads=4, seed=1)
    c = next(c for c in candidates(machine.description, e) if c.kind == kind)
    other = next(c for c in candidates(machine.description, e) if c.kind == "zero_offset")
    own = replace(c, parameters=c.parameters[:1])
    found: Any = SimpleNamespace(
        terms=[Term(own, np.array([1.1]), np.array([0.01]))],
        given=SimpleNamespace(predictor=SimpleNamespace(machine=machine)),
    )
    (named,) = effects_of(found, [Place(own, (), (c, other), (c,))], [{}])
    assert named.aliases == [{"kind": other.kind, "element": other.element, "legs": list(other.legs)}]


def test_an_effect_without_a_corrected_machine_is_refused_and_its_readings_are_not_called_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Effects fail together at rows that the search did not draw: what shows least goes, and the answer is not that nothing is there."""
    fitted = answer.corrected

    def fails(given: Any, starts: Any, *more: Any) -> Any:
        if any(t.candidate.kind == "compliance" for t in starts):
            raise sm.StiffmapError("no equilibrium")
        return fitted(given, starts, *more)

    monkeypatch.setattr(answer, "corrected", fails)
    found = sm.diagnose("orthoglide-revised", DATA / "A-servo", seed=0, cross_validate=False)
    assert "compliance" not in [e.kind for e in found.effects] and found.verdict != "none"
    assert any(r.endswith("no equilibrium") for r in found.refused)


def test_more_than_noise_that_stays_at_the_best_fit_is_no_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the search made of its columns, it is what the machine that is handed over leaves that is judged."""
    good = sm.diagnose("orthoglide-revised", DATA / "B-none", seed=0, cross_validate=False)
    assert good.verdict == "none" and good.noise.lack_of_fit_after > 1e-3

    def worse(*given: Any, **more: Any) -> Any:
        made = written(*given, **more)
        return replace(made, left=(made.left[0], 1.5 * made.left[1]))

    monkeypatch.setattr(answer, "written", worse)
    bad = sm.diagnose("orthoglide-revised", DATA / "B-none", seed=0, cross_validate=False)
    assert bad.verdict == "unattributed" and bad.noise.lack_of_fit_after < 1e-3
    assert bad.unexplained[0].what == answer.UNFITTED and 0.0 < bad.unexplained[0].share <= 1.0
    assert not any("nothing unexplained" in line for line in bad.lines())

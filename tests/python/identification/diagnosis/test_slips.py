"""Units, signs, swaps and shifts in readings are named before any cause, and nothing of them where there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.number_text import within
from stiffmap.experiment import random_plan, simulate
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.sensitivity import plan_of
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.sentences import (
    aliases,
    effect_text,
    measured,
    next_step,
    opening,
)
from stiffmap.identification.diagnosis.slips import find
from stiffmap.identification.diagnosis.slips.axes import Slip
from stiffmap.identification.diagnosis.slips.find import find_slip
from stiffmap.identification.diagnosis.stages import by_gain
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect

Change = Callable[[Experiment], Experiment]


@cache
def readings(name: str, soft: bool = False) -> Experiment:
    machine = sm.load_machine(name)
    terms = []
    if soft:
        element, legs = next(
            p for p in effects.get("compliance").places(machine.description) if len(p[1]) <= 1
        )
        terms = [AppliedEffect("compliance", element, legs, (("scale", 2.15),))]
    return simulate(machine, random_plan(machine, "deflection", poses=12, seed=7), terms, seed=5)


def found(name: str, e: Experiment) -> tuple[Slip, Experiment] | None:
    predictor = Predictor(sm.load_machine(name), e)
    return find_slip(predictor, plan_of(predictor))


def gauges(factor: float, axes: tuple[int, ...] = (0, 1, 2)) -> Change:
    def change(e: Experiment) -> Experiment:
        reading, sigma = e.reading.copy(), e.sigma.copy()
        reading[:, axes] *= factor
        sigma[:, axes] *= abs(factor)
        return replace(e, reading=reading, sigma=sigma)

    return change


def moved_gauges(e: Experiment) -> Experiment:
    reading = e.reading.copy()
    reading[:, 0], reading[:, 2] = -e.reading[:, 2], e.reading[:, 0]
    return replace(e, reading=reading)


def swapped(e: Experiment) -> Experiment:
    reading = e.reading.copy()
    reading[:, [0, 1]] = reading[:, [1, 0]]
    return replace(e, reading=reading)


def forces(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda e: replace(e, wrench=change(e.wrench.copy()))


def shifted(step: int) -> Change:
    return lambda e: replace(e, reading=np.roll(e.reading, step, axis=0))


def one_setup(e: Experiment) -> Experiment:
    """The second of two set-ups, half of the rows, is written in inches."""
    late = np.arange(len(e)) >= len(e) // 2
    by = np.where(late, 1 / 25.4, 1.0)[:, None]
    return replace(e, setup=tuple(np.where(late, "B", "A").tolist()), reading=e.reading * by)


def mirrored(w: np.ndarray) -> np.ndarray:
    w[:, 1] *= -1
    return w


def exchanged(w: np.ndarray) -> np.ndarray:
    w[:, [0, 1]] = w[:, [1, 0]]
    return w


CASES: dict[str, tuple[Change, str, str]] = {
    "sign of y": (gauges(-1.0, (1,)), "sign", "check the sign of y"),
    "all signs": (gauges(-1.0), "sign", "check the sign of all"),
    "swap": (swapped, "swap", "check which gauge is x and which is y"),
    "direction": (moved_gauges, "direction", "check the direction of the gauges"),
    "kgf as N": (forces(lambda w: w / 9.80665), "factor", "kgf (kp) and N mixed up"),
    "lbf as N": (forces(lambda w: w / 4.4482216), "factor", "lbf and N mixed up"),
    "inch as mm": (gauges(1 / 25.4), "factor", "inch and mm"),
    "µm as mm": (gauges(1000.0), "factor", "µm and mm"),
    "inch of one gauge": (gauges(1 / 25.4, (1,)), "factor", "inch and mm"),
    "inch of one set-up": (one_setup, "factor", "inch and mm"),
    "sign of a force": (forces(mirrored), "sign", "check the sign of y of the force"),
    "forces swapped": (forces(exchanged), "swap", "check which force is x and which is y"),
    "one row down": (shifted(1), "shift", "shifted by one row"),
    "one row up": (shifted(-1), "shift", "shifted by one row"),
}
FAST, SLOW = (
    ("orthoglide-revised", "five-bar"),
    ("linear-delta", "ur10", "swing-table", "3-rps"),
)


@cache
def found_in(name: str, case: str, soft: bool = False) -> tuple[Slip, Experiment] | None:
    return found(name, CASES[case][0](readings(name, soft)))


def named(name: str, case: str, soft: bool = False) -> None:
    _, kind, words = CASES[case]
    f = found_in(name, case, soft)
    assert f is not None, (name, case)
    assert f[0].kind == kind, (name, case, f[0])
    assert any(words in text for text in (f[0].check, *f[0].also)), (name, case, f[0])


@pytest.mark.parametrize("case", CASES)
def test_each_mistake_is_named(case: str) -> None:
    named("orthoglide-revised", case)


@pytest.mark.parametrize("case", ["sign of y", "µm as mm", "forces swapped", "one row up"])
def test_mistakes_on_a_planar_machine_are_named(case: str) -> None:
    """One of each kind; a plane has no third direction to confuse."""
    named("five-bar", case)


@pytest.mark.parametrize("name", SLOW)
def test_on_other_machines(name: str) -> None:
    cases = ("sign of y", "swap", "kgf as N", "one row down", "inch as mm")
    for case in cases[:1] if name == "3-rps" else cases:
        named(name, case)
    for soft in (False,) if name == "3-rps" else (False, True):
        assert found(name, readings(name, soft)) is None, (name, soft)


@pytest.mark.parametrize("name", FAST)
def test_good_readings_and_real_faults_raise_no_alarm(name: str) -> None:
    for soft in (False, True):
        assert found(name, readings(name, soft)) is None


@pytest.mark.parametrize("case", ["sign of y", "swap", "direction", "inch as mm", "lbf as N"])
def test_beside_a_real_fault(case: str) -> None:
    named("orthoglide-revised", case, soft=True)


def test_machines_twice_as_soft_are_no_lever() -> None:
    """All of a drive's compliance twice as large on the machine: a cause, which a part explains as well."""
    machine = sm.load_machine("five-bar")
    every = [p for p in effects.get("compliance").places(machine.description) if len(p[1]) == 2]
    for element, legs in every[:3]:
        term = AppliedEffect("compliance", element, legs, (("scale", 2.0),))
        e = simulate(machine, random_plan(machine, "deflection", poses=12, seed=3), [term], seed=4)
        assert found("five-bar", e) is None, element


@pytest.mark.parametrize(("shoulder", "elbow", "axis"), [(2.0, 2.1, 2), (2.1, 2.4, 2), (2.4, 2.7, 0)])
def test_two_soft_drives_before_one_gauge_are_no_unit(shoulder: float, elbow: float, axis: int) -> None:
    """Near a factor of 2, 2.205 or 2.54, but two parts explain more than that factor and a part do; the factor itself is named."""
    machine, every = sm.load_machine("ur10"), effects.get("compliance")
    scales = {"shoulder": shoulder, "elbow": elbow}
    terms = [
        AppliedEffect("compliance", element, legs, (("scale", scales[element]),))
        for element, legs in every.places(machine.description)
        if element in scales and len(legs) == 1
    ]
    plan = random_plan(machine, "deflection", poses=12, seed=7)
    soft, sound = simulate(machine, plan, terms, seed=5), simulate(machine, plan, [], seed=5)
    one = np.where(np.arange(6) == axis, 1.0, np.nan)
    assert found("ur10", replace(soft, reading=soft.reading * one)) is None
    f = found("ur10", gauges(2.0)(replace(sound, reading=sound.reading * one)))
    assert f is not None and "a lever at the gauge" in f[0].check


@pytest.mark.parametrize("case", ["sign of y", "swap", "direction", "sign of a force", "one row down"])
def test_undoing_gives_the_readings_back(case: str) -> None:
    e = readings("orthoglide-revised")
    f = found_in("orthoglide-revised", case)
    assert f is not None
    part = slice(0, len(f[1])) if case == "one row down" else slice(None)
    np.testing.assert_allclose(f[1].reading[:, :3], e.reading[part, :3])
    np.testing.assert_allclose(f[1].wrench, e.wrench[part])


def test_reciprocity_is_the_evidence() -> None:
    f = found_in("orthoglide-revised", "sign of y")
    assert f is not None
    assert any(
        t.startswith("reciprocity is violated") and t.endswith("holds once it is undone")
        for t in f[0].evidence
    )
    assert "linearity holds" in f[0].evidence


def test_the_headline_names_the_unit_before_any_cause() -> None:
    e = CASES["kgf as N"][0](readings("five-bar"))
    d = sm.diagnose("five-bar", e, seed=1, cross_validate=False)
    assert d.verdict == "readings" and d.effects == []
    assert opening(d).startswith("Check first: kgf (kp) and N mixed up")
    assert "With that undone: The machine agrees with its file" in opening(d)
    assert "look for no cause in the machine before" in next_step(d)
    assert d.as_plain()["slips"][0]["kind"] == "factor"
    assert any(line.startswith("readings: check first: kgf") for line in d.lines())


def test_figures_have_the_digits_of_their_interval() -> None:
    assert measured(3.2e-11, 3.1e-11, 3.3e-11, "m") == "3.20e-05 ± 5e-07 µm"
    assert measured(3.2e-11, 3.1999999e-11, 3.2000001e-11, "m").endswith("µm")
    assert " 0.000000 " not in measured(3.2e-11, 3.1999999e-11, 3.2000001e-11, "m")
    assert (
        within(1234.6, 56.0) == "1230"
        and within(0.3007, 0.0008) == "0.3007"
        and within(2.0, 0.014) == "2.000"
    )


def test_aliases_stand_in_the_headline() -> None:
    d = sm.diagnose("orthoglide-revised", readings("orthoglide-revised", True), seed=1, cross_validate=False)
    (effect,) = d.effects
    if effect.aliases:
        assert "these readings cannot distinguish it from " in opening(d)
    assert aliases(replace(effect, aliases=[])) == ""
    made = replace(effect, aliases=[{"kind": "compliance", "element": "actuator", "legs": ["z"]}] * 2)
    assert aliases(made).count("(drive of leg z)") == 1
    assert effect_text(made).endswith(
        "(these readings cannot distinguish it from compliance of actuator, leg z)"
    )


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (9.79, 9.84, "check first: kgf (kp) and N mixed up"),
        (4.40, 4.46, "check first: lbf and N mixed up"),
        (7.0, 7.2, ""),
    ],
)
def test_a_gain_beside_a_cause_names_the_unit(low: float, high: float, words: str) -> None:
    """Readings of which a soft part as well makes a factor that no unit is: the gain found beside it says which."""
    units = "check the units of force and gauge, and any lever"
    s = Slip("factor", "all readings are 11.96 times what the file predicts", units, (), 0.1, False)
    e = Effect("load_gain", "load", (), {"gain": ((low + high) / 2, low, high, "1")}, [], {})
    assert by_gain(s, [e]).check == (words or units)
    assert by_gain(s, []) == s
    assert by_gain(replace(s, undone=True), [e]).check == units


@pytest.mark.parametrize("case", ["sign of y", "lbf as N", "one row down"])
def test_of_many_rows_the_first_ones_say_it(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Undone is the mistake in all rows."""
    e = readings("orthoglide-revised")
    monkeypatch.setattr(find, "ROWS", len(e) - 4)
    f = found("orthoglide-revised", CASES[case][0](e))
    assert f is not None and f[0].kind == CASES[case][1]
    assert len(f[1]) >= len(e) - 1

"""A kind of effect that the library does not have is one new file: it registers, and a diagnosis names it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan, simulate
from stiffmap.identification.candidates.candidates import candidates, of_kind
from stiffmap.identification.candidates.sensitivity import variants
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.registry import load_effects, register, unregister
from stiffmap.ui.cli.app import main

# Two harmonics of one gear tied together; its size counts in decades, so that no value makes it vanish.
WORN_PINION = """
from collections.abc import Iterator
from dataclasses import replace
from math import log10, pi

import numpy as np

from stiffmap.model.description import AppliedEffect, CommandError, MachineDescription
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.evidence import Probe, Signature, Tried
from stiffmap.model.effects.sites import at_sites, drives
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    size, period, phase = 10 ** placed.values["decades"], placed.values["pitch"], placed.values["phase"]
    errors = [CommandError(amplitude=size / k, period=period / k, phase=k * phase, reference=None) for k in (1, 2)]
    change = lambda e: (replace(e, command_errors=(*e.command_errors, *errors)),)
    return change_sites(description, placed.legs, placed.element, drives, change)


def signature(probe: Probe, tried: Tried) -> Iterator[Signature]:
    legs = tried.legs or ("",)
    u = {leg: probe.coordinate(tried.element, leg) for leg in legs}
    unit = {
        leg: probe.change(AppliedEffect("zero_offset", tried.element, (leg,) if leg else (), (("error", 1e-5),))) / 1e-5
        for leg in legs
    }
    for pitch in 1.0 / np.arange(11.0, 21.0):
        for phase in np.arange(8) * pi / 4:
            parts = []
            for leg in legs:
                w = 2 * pi * u[leg] / pitch + phase
                parts.append(unit[leg] * (np.sin(w) + np.sin(2 * w) / 2)[:, None])
            yield Signature(
                {"pitch": pitch, "phase": float(phase)},
                sum(parts)[..., None] * 1e-5,
                lambda strength: {"decades": log10(max(float(strength[0]) * 1e-5, 1e-8))},
                grows=True,
            )


EFFECT = EffectType(
    kind="worn_pinion",
    title="pinion worn to two harmonics",
    doc="The drive stands 10^decades (sin w + sin(2w)/2) further, w = 2 pi (u - u_home)/pitch + phase.",
    parameters=(
        Parameter("decades", "1", -8.0, -2.0, None, 0.1, "size in powers of ten of a metre"),
        Parameter("pitch", "m", 0.01, 0.2, None, 0.01, "travel after which it repeats"),
        Parameter("phase", "rad", -7.0, 7.0, None, 1.0, "at home"),
    ),
    places=at_sites(drives),
    apply=apply,
    signature=signature,
)
"""

# An instrument's error with a radius that is infinite where there is none.
LENS = """
import numpy as np

from stiffmap.model.effects.evidence import Signature
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import EffectType, Parameter


def shift(plan, radius):
    p = plan.position - plan.position.mean(axis=0)
    return p * (p**2).sum(axis=1, keepdims=True) / radius**2


def reading(read, motion, plan, term):
    values = dict(term.parameters)
    return np.hstack([read[:, :3] + shift(plan, values["radius"]), read[:, 3:]])


def signature(probe, tried):
    column = np.zeros_like(probe.base)
    column[:, :3] = shift(probe.plan, 100.0)
    yield Signature({}, column[..., None], lambda s: {"radius": 100.0 / max(float(s[0]), 1e-6) ** 0.5}, grows=True)


EFFECT = EffectType(
    kind="lens_distortion",
    title="distortion of a camera's lens",
    doc="A position reads further out by r^3/radius^2 at the distance r from the middle of the plan.",
    parameters=(Parameter("radius", "m", 1.0, 1e4, None, 1.0, "of the distortion"),),
    places=at("sensor"),
    apply=None,
    reading=reading,
    signature=signature,
    hidden=lambda plan: plan.quantity != "position",
)
"""


@pytest.fixture
def known(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[effects.EffectType]:
    file = tmp_path / "mine.py"
    file.write_text(request.param, encoding="utf-8")
    (kind,) = load_effects(file)
    yield kind
    unregister(kind.kind)


@pytest.mark.parametrize("known", [WORN_PINION], indirect=True)
def test_a_diagnosis_names_a_shape_that_the_library_does_not_have(known: effects.EffectType) -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, poses=80, quantity="position", noise=1e-6, seed=3)
    truth = {"decades": -4.4, "pitch": 0.066, "phase": 0.9}
    there = AppliedEffect("worn_pinion", "actuator", ("y",), tuple(truth.items()))
    found = sm.diagnose(machine, simulate(machine, plan, [there], seed=4), seed=0, cross_validate=False)
    assert found.verdict == "effects"
    assert [(e.kind, e.element, e.legs) for e in found.effects] == [("worn_pinion", "actuator", ("y",))]
    for name, value in truth.items():
        _, low, high, _ = found.effects[0].parameters[name]
        assert low <= value <= high, name
    assert "pinion worn" in found._repr_html_()
    assert found.machine.description.effects[0].kind == "worn_pinion"


@pytest.mark.parametrize("known", [LENS], indirect=True)
def test_a_diagnosis_names_an_instrument_with_an_error_of_its_own(known: effects.EffectType) -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, poses=20, quantity="position", noise=1e-6, seed=3)
    there = AppliedEffect("lens_distortion", "sensor", (), (("radius", 20.0),))
    found = sm.diagnose(machine, simulate(machine, plan, [there], seed=4), seed=0, cross_validate=False)
    assert [(e.kind, e.element) for e in found.effects] == [("lens_distortion", "sensor")]
    assert found.effects[0].parameters["radius"][0] == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize("known", [LENS], indirect=True)
def test_what_hides_an_effect_is_said_by_the_effect(known: effects.EffectType) -> None:
    machine = sm.load_machine("orthoglide-revised")
    seen = {
        quantity: {
            c.kind for c in candidates(machine.description, random_plan(machine, poses=9, quantity=quantity))
        }
        for quantity in ("position", "deflection")
    }
    assert "lens_distortion" in seen["position"] - seen["deflection"]


@pytest.mark.parametrize("known", [WORN_PINION], indirect=True)
def test_a_new_kind_works_wherever_a_kind_does(known: effects.EffectType, tmp_path: Path) -> None:
    machine = sm.load_machine("five-bar")
    element, legs = known.places(machine.description)[0]
    with pytest.raises(sm.StiffmapError, match=r"worn_pinion: pitch: expected 0\.01 to 0\.2 m, got 1e-09"):
        machine.with_effect("worn_pinion", element=element, legs=legs, decades=-3.0, pitch=1e-9, phase=0.0)
    worn = machine.with_effect("worn_pinion", element=element, legs=legs, decades=-3.0, pitch=0.05, phase=0.3)
    worn.save(tmp_path / "worn.yaml")
    again = sm.load_machine(tmp_path / "worn.yaml")
    assert again.description == worn.description
    assert np.any(worn.solve([0.0, 0.0, 0.0]).displacement != machine.solve([0.0, 0.0, 0.0]).displacement)
    assert "worn_pinion" in effects.kinds()


def test_a_parameter_without_null_is_tried_where_its_effect_says_nothing_of_it() -> None:
    """No signature: the knee of a spring is tried at multiples of its scale, and one of them is near."""
    machine = sm.load_machine("orthoglide-revised")
    predictor = Predictor(machine, random_plan(machine, poses=6, seed=1))
    silent = register(replace(effects.get("bilinear"), kind="silent", signature=None))
    try:
        candidate = of_kind(silent, machine.description)[0]
        found = list(variants(candidate, predictor, predictor()))
        assert [dict(v.shape)["knee"] for v in found] == pytest.approx([10.0, 30.0, 100.0, 300.0, 1000.0])
        assert all(v is not None and v.lines().any() for v in found[:3])
    finally:
        unregister("silent")


def test_the_command_line_takes_a_file_of_effects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "lens.py"
    file.write_text(LENS, encoding="utf-8")
    try:
        assert main(["--effects-from", str(file), "effects", "lens_distortion"]) == 0
        assert "distortion of a camera's lens" in capsys.readouterr().out
    finally:
        unregister("lens_distortion")
    assert main(["--effects-from", str(tmp_path / "none.py"), "effects"]) == 2
    assert "none.py: cannot be read" in capsys.readouterr().err


def test_definitions_that_contradict_themselves_are_refused(tmp_path: Path) -> None:
    bilinear = effects.get("bilinear")
    with pytest.raises(sm.StiffmapError, match="the library has a kind of that name"):
        register(bilinear)
    with pytest.raises(sm.StiffmapError, match="needs 'moon'; known: temperature"):
        register(replace(bilinear, kind="mine", needs=("moon",)))
    with pytest.raises(sm.StiffmapError, match="one of apply, load, reading, drive"):
        register(replace(bilinear, kind="mine", apply=None))
    (tmp_path / "nothing.py").write_text("x = 1\n", encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match=r"nothing\.py: defines no effect"):
        load_effects(tmp_path / "nothing.py")
    (tmp_path / "broken.py").write_text("x = \n", encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match=r"broken\.py: cannot be run: SyntaxError"):
        load_effects(tmp_path / "broken.py")
    assert "mine" not in effects.kinds()

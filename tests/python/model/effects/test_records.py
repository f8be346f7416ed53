"""Records of effects: order, saving and loading, texts."""

from __future__ import annotations

import pickle

import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import apply_records, effect_text, get, kinds, parse_effect

SEVERAL = (
    {"kind": "friction", "element": "actuator", "legs": ["y"], "force": 20.0, "branch": "unloading"},
    {"kind": "tilt", "element": "actuator", "legs": ["x"], "angle_y": 3e-4},
    {"kind": "compliance", "element": "actuator", "scale": 1.7},
    {"kind": "position_offset", "element": "actuator", "legs": ["x"], "error_y": 1e-4},
    {"kind": "dead_zone", "element": "actuator", "legs": ["y"], "half_width": 12e-6},
    {"kind": "joint_compliance", "element": "bar", "translation": 1e-8},
    {"kind": "gravity", "scale": 1.0},
    {"kind": "payload", "mass": 2.0},
    {"kind": "payload", "mass": 1.0, "com_x": 0.1},
)


def with_all(machine, effects):
    for effect in effects:
        machine = machine.with_effect(**effect)
    return machine


def test_order_is_no_matter(orthoglide):
    position, wrench = [0.12, -0.08, 0.21], [250.0, -100, 60, 0, 0, 0]
    a = with_all(orthoglide, SEVERAL).solve(position, wrench)
    b = with_all(orthoglide, SEVERAL[::-1]).solve(position, wrench)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-14)
    assert a.status == sm.Status.CONVERGED


def test_saved_machine_loads_back_equal(orthoglide, tmp_path):
    machine = with_all(orthoglide, SEVERAL)
    machine.save(tmp_path / "machine.yaml")
    again = sm.load_machine(tmp_path / "machine.yaml")
    assert again == machine
    assert again.description.declared == orthoglide.description
    assert again.description.effects == machine.description.effects


def test_pickles(orthoglide):
    machine = with_all(orthoglide, SEVERAL)
    assert pickle.loads(pickle.dumps(machine)) == machine


def test_original_is_untouched(orthoglide):
    before = orthoglide.description
    with_all(orthoglide, SEVERAL)
    assert orthoglide.description == before and not orthoglide.description.effects


TEXTS = {
    "dead_zone actuator y half_width=12um": (("half_width", 12e-6),),
    "dead_zone actuator x,y half_width = 0.012 mm": (("half_width", 12e-6),),
    "compliance actuator z value=3e-4mm/N": (("value", 3e-7),),
    "tilt actuator x angle_y=0.3mrad angle_z=-0.0114591559deg": (("angle_y", 3e-4), ("angle_z", -2e-4)),
    "thermal_growth bar coefficient=11.5e-6/K temperature_difference=8 K": (
        ("coefficient", 11.5e-6),
        ("temperature_difference", 8.0),
    ),
    "joint_compliance bar all rotation=2 urad/(N*m)": (("rotation", 2e-6),),
    "hardening actuator cubic=4e5 N/mm^3": (("cubic", 4e14),),
    "lead_error actuator x slope=50um/m": (("slope", 5e-5),),
    "gravity scale=1": (("scale", 1.0),),
    "payload mass=350g": (("mass", 0.35),),
    "friction actuator force=0.02kN branch=unloading": (("force", 20.0),),
}


@pytest.mark.parametrize("text", TEXTS)
def test_text_in_any_unit(text):
    got = parse_effect(text)
    assert [n for n, _ in got.parameters] == [n for n, _ in TEXTS[text]]
    assert [v for _, v in got.parameters] == pytest.approx([v for _, v in TEXTS[text]], rel=1e-9)


def test_decimal_values_are_rounded_once():
    assert parse_effect("dead_zone actuator y half_width=12um").parameters == (("half_width", 12e-6),)
    assert parse_effect("length bar error=0.15mm").parameters == (("error", 0.15e-3),)


def test_place_and_options_of_a_text():
    record = parse_effect("friction actuator x,z force=20N branch=unloading")
    assert (record.element, record.legs, record.options) == (
        "actuator",
        ("x", "z"),
        (("branch", "unloading"),),
    )


@pytest.mark.parametrize("kind", kinds())
def test_text_of_a_record_reads_back(kind):
    effect = get(kind)
    numbers = tuple((p.name, 0.1 + 1 / 3 * p.scale) for p in effect.parameters)
    options = tuple((o.name, o.choices[-1]) for o in effect.options)
    record = AppliedEffect(kind, "actuator", ("x", "y"), numbers, options)
    assert parse_effect(effect_text(record)) == record


def test_text_makes_a_machine(orthoglide):
    record = parse_effect("dead_zone actuator y half_width=12um")
    expected = orthoglide.with_effect("dead_zone", element="actuator", legs=["y"], half_width=12e-6)
    assert apply_records(orthoglide.description, [record]) == expected.description


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("dead_zone actuator y half_width=12", "unit is missing"),
        ("dead_zone actuator y half_width=12N", "unit such as m"),
        ("dead_zone actuator y half_width=12parsec", "unknown unit 'parsec'"),
        ("dead_zone actuator y half_width=um", "expected a number with a unit"),
        ("dead_zone actuator y width=12um", "unknown parameter 'width'"),
        ("dead_zone actuator y half_width=1um half_width=2um", "given twice"),
        ("dead_zone actuator y z half_width=12um", "cannot read"),
        ("deadzone actuator", "did you mean 'dead_zone'"),
        ("  ", "empty effect"),
    ],
)
def test_bad_text_is_one_clear_error(text, message):
    with pytest.raises(StiffmapError, match=message) as error:
        parse_effect(text)
    assert "\n" not in str(error.value)

"""What a diagnosis prints was found: no parameter that the readings leave open, none at a bound, in a name or in an alternative."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.experiment.prediction.test_history import PLAIN, deflection, measured_ramps, ramps

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.identification.candidates.candidates import of_kind
from stiffmap.identification.diagnosis import Effect
from stiffmap.identification.inference.places import possible
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import registry

Values = tuple[tuple[str, float], ...]


def effects(d: sm.Diagnosis) -> list[Effect]:
    """Those that are named and those that would do instead."""
    return [*d.effects, *(a for other in d.alternatives for a in other)]


def holds(d: sm.Diagnosis) -> None:
    """Raises unless each interval of each effect says something."""
    for e in effects(d):
        for p in registry.get(e.kind).parameters_at(d.declared.description, e.element, e.legs):
            value, low, high, _ = e.parameters.get(p.name, (p.null or p.scale, 0.0, 0.0, ""))
            least, most = possible(p)
            assert (low, high) != pytest.approx((least, most)), str(e)
            at = [b for b in (least, most) if b != p.null and value == pytest.approx(b)]
            assert not at, str(e)


@pytest.mark.parametrize(
    ("machine", "quantity", "poses", "loads", "kind", "element", "legs", "values", "untold", "seed"),
    [
        (  # forces alone turn nothing
            "five-bar", "deflection", 5, 4, "tool_compliance", "platform", (),
            (("translation", 6e-7), ("rotation", 0.0)), ("rotation",), 56,
        ),
        (  # an axis turned about itself
            "linear-delta", "position", 6, 9, "axis_tilt", "carriage", ("a", "b", "c"),
            (("angle_x", 1.5e-3), ("angle_y", 1e-3), ("angle_z", 0.0)), ("angle_z",), 2,
        ),
        (
            "orthoglide-revised", "position", 10, 9, "external_spring", "tcp", (),
            (("stiffness", 130.0), ("length", 0.0), ("anchor_x", 0.8), ("anchor_y", 0.1), ("anchor_z", 0.0)), ("length",), 96,
        ),
        (  # its alternatives turn and shift what a plane machine does not show
            "five-bar", "position", 4, 6, "gravity", "machine", (), (("scale", 1.0),), (), 1,
        ),
    ],
)  # fmt: skip
def test_an_effect_is_named_without_what_readings_leave_open(
    machine: str,
    quantity: str,
    poses: int,
    loads: int,
    kind: str,
    element: str,
    legs: tuple[str, ...],
    values: Values,
    untold: tuple[str, ...],
    seed: int,
) -> None:
    m = sm.load_machine(machine)
    p = Predictor(m, random_plan(m, quantity, poses=poses, loads=loads, seed=seed))
    noise = np.nan_to_num(p.experiment.sigma) * np.random.default_rng(seed).standard_normal(p().shape)
    shown = p((AppliedEffect(kind, element, legs, values),)) + noise
    d = sm.diagnose(m, p.experiment.with_readings(shown), cross_validate=False)
    (found,) = [e for e in effects(d) if (e.kind, e.legs) == (kind, legs)]
    assert not set(untold) & found.parameters.keys()
    holds(d)


def test_friction_is_named_without_a_play_that_is_not_there(tmp_path: Path) -> None:
    one = ramps(40.0, 20)
    twist = np.degrees(np.tile(deflection(one, 1e-3, PLAIN | {"level": 5.0}), 3))
    twist += 0.02 * np.random.default_rng(4).standard_normal(len(twist))
    folder = measured_ramps(tmp_path / "ramps", twist, np.tile(one, 3), 0.02)
    d = sm.diagnose(str(folder / "gear.yaml"), folder, cross_validate=False)
    assert [e.kind for e in d.effects] == ["hysteresis"] and "seat" not in d.effects[0].parameters
    holds(d)


def test_a_constant_force_is_no_spring_from_far_away() -> None:
    """A leaning weight pulls as a spring does whose anchor is tens of metres off."""
    m = sm.load_machine("ur10")
    (spring,) = of_kind(registry.get("external_spring"), m.description)
    anchor = [p for p in spring.parameters if p.name.startswith("anchor")]
    assert [(p.lower, p.upper) for p in anchor] == [(-10.0, 10.0)] * 3

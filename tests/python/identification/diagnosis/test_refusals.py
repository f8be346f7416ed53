"""Values with which an effect is never named: one rule after the other, over the kinds that have them."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.identification.calibration import Tolerances
from stiffmap.identification.diagnosis.candidates.candidates import Candidate, of_kind
from stiffmap.identification.diagnosis.decision.refusals import RULES, why_not
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.model import effects
from stiffmap.model.effects import registry
from stiffmap.solve.machine import load_machine

MACHINE = load_machine("ur10").description


def candidate(kind: str, element: str = "") -> Candidate:
    found = of_kind(effects.get(kind), MACHINE)
    return next(c for c in found if not element or c.element == element)


def model(c: Candidate, *si: float, seen: float = 1e6) -> Model:
    """An effect with values (SI); each parameter is seen by readings of its own, to `seen` standard deviations per range."""
    scales = np.array([p.scale for p in c.parameters])
    widths = np.array([(p.upper - p.lower) / p.scale for p in c.parameters])
    jacobian = np.vstack([np.diag(seen / widths), np.zeros((3, len(scales)))])
    return Model((c,), np.array(si) / scales, 1.0, jacobian, np.zeros(len(jacobian)))


@pytest.mark.parametrize(
    ("kind", "element", "values", "why"),
    [
        ("compliance", "shoulder", (2.1,), ""),
        ("compliance", "shoulder", (0.001,), "scale is at its bound"),
        ("compliance", "shoulder", (1000.0,), "scale is at its bound"),
        ("compliance", "shoulder", (0.02,), "no part yields 0.02 times"),
        ("compliance", "shoulder", (140.0,), "no part yields 140 times"),
        ("tilt", "wrist_1", (0.0119, 0.0, 0.0), ""),
        ("tilt", "wrist_1", (-0.1, 0.0, 0.0), "angle_x is at its bound"),
        ("tilt", "wrist_1", (0.0, 0.06, 0.0), "no assembled part is turned by 60 mrad"),
        ("position_offset", "wrist_1", (2e-4, 0.0, 0.0), ""),
        ("position_offset", "wrist_1", (0.07, 0.0, 0.0), "no assembled part is 70 mm off"),
        ("gravity", "machine", (1.0,), ""),
        ("gravity", "machine", (-1.0,), "no masses are -1 times"),
        ("gravity", "machine", (8.0,), "no masses are 8 times"),
        ("sensor_gain", "sensor", (0.1,), "gain is at its bound"),
        ("sensor_gain", "sensor", (1.02,), "beyond the instrument's certificate"),
        ("zero_offset", "elbow", (0.1,), "error is at its bound"),
        ("dead_zone", "elbow", (1e-4,), ""),
        ("dead_zone", "elbow", (0.5,), "half_width is at its bound"),
    ],
)
def test_rules(kind: str, element: str, values: tuple[float, ...], why: str) -> None:
    m = model(candidate(kind, element), *values)
    told = why_not(m, 0, Tolerances())
    assert why in told and bool(told) is bool(why)


@pytest.mark.parametrize("kind", [k for k in registry.kinds() if of_kind(effects.get(k), MACHINE)])
def test_no_kind_is_named_with_its_whole_range_as_interval(kind: str) -> None:
    """[0, 81] N/m, or ± 100 m: what the readings do not determine they do not demand."""
    c = candidate(kind)
    middle = [p.null if p.null is not None else min(max(p.scale, p.lower), p.upper) for p in c.parameters]
    blind = model(c, *middle, seen=3.0)
    assert "the readings do not determine" in why_not(blind, 0, Tolerances())
    size = [p.null is not None for p in c.parameters]
    half = model(c, *middle)
    assert half.jacobian is not None
    shape_only = np.where(size, 1e-6, 1.0) * half.jacobian[: len(size)]
    seen = Model(
        (c,), half.values, 1.0, np.vstack([shape_only, np.zeros((3, len(size)))]), np.zeros(len(size) + 3)
    )
    if any(size):
        assert "the readings do not determine" in why_not(seen, 0, Tolerances())


def test_each_rule_has_a_name_that_says_what_it_refuses() -> None:
    assert len({r.__name__ for r in RULES}) == len(RULES) == 7
    assert all(r.__doc__ for r in RULES)

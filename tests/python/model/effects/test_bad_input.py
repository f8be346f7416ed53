"""What cannot be is one clear error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError

DRIVE = {"element": "actuator", "legs": ["y"]}
GAP = {"kind": "dead_zone", **DRIVE}
BAD = {
    "no effect 'backlash' (did you mean 'dead_zone'?); there are: compliance, dead_zone": {"kind": "backlash"},
    "did you mean 'hardening'": {"kind": "hardning"},
    "no element 'spindle' that it can act on; there are: actuator": {
        "kind": "dead_zone", "element": "spindle", "half_width": 1e-5,
    },
    "say on which element; there are: actuator, foot, foot.k11": {"kind": "compliance", "scale": 2.0},
    "no leg 'w' has it; legs that do: x, y, z": {
        "kind": "dead_zone", "element": "actuator", "legs": ["w"], "half_width": 1e-5,
    },
    "no leg 'xy' has it; legs that do: x, y, z": {**GAP, "legs": "xy", "half_width": 1e-5},
    "legs: expected different names, got 'y' twice": {**GAP, "legs": ["y", "x", "y"], "half_width": 1e-5},
    "half_width: expected 0 to 0.01 m, got -1e-05": {"kind": "dead_zone", **DRIVE, "half_width": -1e-5},
    "half_width: expected 0 to 0.01 m, got 12": {"kind": "dead_zone", **DRIVE, "half_width": 12},
    "half_width: expected a finite number in m, got nan": {**GAP, "half_width": np.nan},
    "half_width: expected a finite number in m, got '12um'": {**GAP, "half_width": "12um"},
    "half_width is missing": {"kind": "dead_zone", **DRIVE},
    "unknown parameter 'width'": {"kind": "dead_zone", **DRIVE, "width": 1e-5},
    "give exactly one of scale, value": {"kind": "compliance", **DRIVE, "scale": 2.0, "value": 1e-7},
    "give at least one of angle_x, angle_y, angle_z": {"kind": "tilt", **DRIVE},
    "value is for elements with one direction": {"kind": "compliance", "element": "foot", "value": 1e-7},
    "scale: expected 0.751 to 1000": {"kind": "compliance", "element": "bar.k22", "scale": 0.5},
    "branch: expected one of loading, unloading, loading_stuck, got 'up'": {
        "kind": "friction", **DRIVE, "force": 5.0, "branch": "up",
    },
    "give torque": {"kind": "friction", **DRIVE, "torque": 5.0},
    "no compliance is left": {"kind": "position_dependent_compliance", **DRIVE, "slope": 20.0},
    "no element 'bar' that it can act on": {"kind": "gravity", "element": "bar", "mass": 2.0},
}  # fmt: skip


@pytest.mark.parametrize("message", BAD)
def test_message(orthoglide, message):
    with pytest.raises(StiffmapError) as error:
        orthoglide.with_effect(**BAD[message])
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "size", [{"kind": "hardening", "cubic": 1e14}, {"kind": "dead_zone", "half_width": 1e-5}]
)
def test_effects_that_exclude_each_other(orthoglide, size):
    machine = orthoglide.with_effect("dead_zone", element="actuator", half_width=1e-5)
    with pytest.raises(StiffmapError, match=r"exclude each other on actuator, leg y; remove one"):
        machine.with_effect(**DRIVE, **size)
    other = orthoglide.with_effect("dead_zone", element="actuator", legs=["x"], half_width=1e-5)
    assert other == orthoglide.with_effect("dead_zone", element="actuator", legs="x", half_width=1e-5)
    assert len(other.with_effect(**DRIVE, **size).description.effects) == 2


def test_declared_law_is_not_overruled(orthoglide):
    """A drive whose file gives it a law that the effect cannot join."""
    hard = orthoglide.with_effect("hardening", element="actuator", cubic=1e14).description
    machine = sm.Machine(replace(hard, effects=(), declared=None))
    with pytest.raises(StiffmapError, match="declared nonlinear law"):
        machine.with_effect("dead_zone", **DRIVE, half_width=1e-5)


def test_change_by_other_means_is_not_lost(orthoglide):
    changed = replace(
        orthoglide.with_effect("gravity", scale=1.0).with_effect("payload", mass=1.0).description,
        gravity=(0.0, -9.81, 0.0),
    )
    with pytest.raises(StiffmapError, match="changed by other means"):
        sm.Machine(changed).with_effect("compliance", element="actuator", scale=2.0)


def test_record_without_its_declared_machine(orthoglide):
    bare = replace(orthoglide.with_effect("gravity", scale=1.0).description, declared=None)
    with pytest.raises(StiffmapError, match="not the machine before them"):
        sm.Machine(bare).with_effect("payload", mass=1.0)

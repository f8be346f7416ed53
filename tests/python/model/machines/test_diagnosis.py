"""A diagnosis names the one thing that is wrong with a virtual twin, for every shipped machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.model.machines import machine_cases as cases

import stiffmap as sm
from stiffmap.experiment import Experiment, random_plan, simulate
from stiffmap.model.description import AppliedEffect

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")

# machine -> drive, legs, error of its zero (m or rad), poses
ZERO = {
    "orthoglide-original": ("actuator", ("y",), 3e-4, 12),
    "orthoglide-revised": ("actuator", ("z",), -3e-4, 12),
    "tripteron": ("actuator", ("2",), 2e-4, 12),
    "hexapod": ("strut", ("3",), 2e-4, 12),
    "linear-delta": ("carriage", ("b",), -2e-4, 12),
    "rotary-delta": ("motor", ("c",), 1e-3, 12),
    "ur10": ("elbow", ("arm",), 1e-3, 12),
    "five-bar": ("motor", ("left",), -1e-3, 12),
    "swing-table": ("motor", ("front_left",), 1e-3, 12),
    "hybrid": ("carriage", ("a",), 2e-4, 10),
    "3-rps": ("strut", ("b",), 1e-3, 12),
    "travelling-column": ("head_drive", ("machine",), 2e-4, 12),
}

# machine -> drive, legs, true compliance over the declared one, largest force (N), poses
SOFT = {
    "ur10": ("elbow", ("arm",), 3.0, 50.0, 4),
    "five-bar": ("motor", ("left",), 3.0, 50.0, 4),
    "swing-table": ("motor", ("front_left",), 3.0, 50.0, 4),
    "hexapod": ("strut", ("3",), 4.0, 1500.0, 6),
    "linear-delta": ("carriage", ("b",), 3.0, 10.0, 4),
    "rotary-delta": ("motor", ("c",), 3.0, 50.0, 4),
    "hybrid": ("carriage", ("a",), 4.0, 600.0, 6),
}


def named(d: sm.Diagnosis) -> list[tuple[str, str, tuple[str, ...]]]:
    return [(e.kind, e.element, tuple(e.legs)) for e in d.effects]


def tilted(plan: Experiment) -> Experiment:
    """The plan with a tilt of its own for each pose (two repeats each)."""
    a, b = np.repeat(np.random.default_rng(3).uniform(-0.25, 0.25, (2, len(plan.position) // 2)), 2, axis=1)
    turns = [cases.turn("x", i) @ cases.turn("y", j) for i, j in zip(a, b, strict=True)]
    return replace(plan, rotation=np.array(turns))


def test_every_shipped_machine_is_a_case() -> None:
    assert set(ZERO) == {*cases.FLAGS, "tripteron"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * n.startswith("hybrid")) for n in ZERO]
)
def test_zero_of_a_drive(name: str) -> None:
    element, legs, error, poses = ZERO[name]
    machine = sm.load_machine(name)
    plan = random_plan(machine, "position", poses=poses, seed=7)
    if name == "3-rps":  # level, its legs are all alike
        plan = tilted(plan)
    wrong = AppliedEffect("zero_offset", element, legs, (("error", error),))
    d = sm.diagnose(machine, simulate(machine, plan, [wrong], seed=1), cross_validate=False)
    assert d.verdict == "effects" and named(d) == [("zero_offset", element, legs)], str(d)
    _, low, high, _ = d.effects[0].parameters["error"]
    assert low <= error <= high


@pytest.mark.slow
@pytest.mark.parametrize("name", SOFT)
def test_soft_drive(name: str) -> None:
    """Loads find a drive softer than declared; what the plan cannot distinguish from it may only stand beside it."""
    element, legs, scale, force, poses = SOFT[name]
    machine = sm.load_machine(name)
    plan = random_plan(machine, "deflection", poses=poses, loads=6, force=force, seed=7)
    soft = AppliedEffect("compliance", element, legs, (("scale", scale),))
    d = sm.diagnose(machine, simulate(machine, plan, [soft], seed=1), cross_validate=False)
    assert d.verdict in ("effects", "ambiguous") and named(d) == [("compliance", element, legs)], str(d)
    _, low, high, _ = d.effects[0].parameters["scale"]
    assert low <= scale <= high

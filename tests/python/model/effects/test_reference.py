"""Every case of the independent program, one effect at a time, within its stated tolerance."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm

FILE = Path(__file__).parents[3] / "data" / "reference" / "effects.json"
CASES = json.loads(FILE.read_text())["cases"]

EFFECTS: dict[str, dict] = {
    "drive compliance": {"kind": "compliance", "element": "actuator", "legs": ["z"], "value": 2.2e-7},
    "foot compliance": {"kind": "compliance", "element": "foot", "legs": ["x"], "scale": 1.7},
    "bar compliance": {"kind": "compliance", "element": "bar", "legs": ["y"], "scale": 2.0},
    "dead zone": {"kind": "dead_zone", "element": "actuator", "legs": ["x"], "half_width": 8e-6},
    "hardening": {"kind": "hardening", "element": "actuator", "cubic": 4e14},
    "joint compliance": {"kind": "joint_compliance", "element": "bar", "translation": 1e-8},
    "gravity": {"kind": "gravity", "element": "machine", "scale": 1.0},
    "length": {"kind": "length", "element": "bar", "legs": ["z"], "error": 1e-4},
    "zero offset": {"kind": "zero_offset", "element": "actuator", "legs": ["y"], "error": -5e-5},
    "tilt": {"kind": "tilt", "element": "actuator", "legs": ["x"], "angle_y": 3e-4, "angle_z": -2e-4},
    "drive friction": {"kind": "friction", "element": "actuator", "force": 20.0},
}


def machine_of(machine: sm.Machine, case: dict) -> sm.Machine:
    if case["effect"] == "none":
        return machine
    branch = {"branch": case["branch"]} if "branch" in case else {}
    return machine.with_effect(**EFFECTS[case["effect"]], **branch)


def label(case: dict) -> str:
    return "-".join([case["effect"], case.get("branch", ""), str(case["pose_mm"]), str(case["force_N"])])


def test_the_file_holds_all_the_effects_that_are_told_here():
    assert {c["effect"] for c in CASES} == {*EFFECTS, "none"}
    assert len(CASES) == 111


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize("case", CASES, ids=label)
def test_case(orthoglide, case, method):
    machine = machine_of(orthoglide, case)
    force = np.array([*case["force_N"], 0.0, 0.0, 0.0])
    solution = machine.solve(np.array(case["pose_mm"]) * 1e-3, force, method=method)
    expected = np.array(case["displacement"]) * [1e-3, 1e-3, 1e-3, 1, 1, 1]
    error = np.abs(solution.displacement - expected)
    assert error[:3].max() <= case["tolerance_mm"] * 1e-3
    assert error[3:].max() <= case["tolerance_mm"]  # over arms of a metre: rad as mm is generous to none
    free_play = case["effect"] == "dead zone" and not force.any()
    assert solution.status == (sm.Status.SINGULAR if free_play else sm.Status.CONVERGED)


def test_sticking_differs_in_one_case_of_the_loading_branch(orthoglide):
    """Leg z bears 6.6 N of a level of 20 N in one case: there a contact sticks, the reference does not."""
    machine = orthoglide.with_effect("friction", element="actuator", force=20.0, branch="loading_stuck")
    apart = []
    for case in (c for c in CASES if c.get("branch") == "loading"):
        solution = machine.solve(np.array(case["pose_mm"]) * 1e-3, [*case["force_N"], 0, 0, 0])
        apart.append(np.abs(solution.displacement[:3] - np.array(case["displacement"][:3]) * 1e-3).max())
        lowest = np.abs(solution.actuator_effort).min()
        assert (lowest < 20.0) == (apart[-1] > 1e-12)
    assert sorted(apart)[-1] == pytest.approx(1.92e-6, rel=0.01) and sorted(apart)[-2] < 1e-12

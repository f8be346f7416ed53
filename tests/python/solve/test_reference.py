"""The Orthoglide against an independent energy-minimisation program (tests/data/reference)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm

DATA = json.loads((Path(__file__).parents[2] / "data/reference/orthoglide_revised.json").read_text())
LENGTH = np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0, 1.0])  # mm, rad -> m, rad
FORCE = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])  # N, N·mm -> N, N·m
METHODS = ("fast", "reference")
CASES = DATA["cases"] + DATA["large_loads"]


def solve(machine: sm.Machine, case: dict[str, Any], method: str, loaded: bool = True) -> sm.Solution:
    position = np.array(case["pose_mm"]) * 1e-3
    wrench = np.array(case["wrench_N"]) * FORCE if loaded else None
    solution = machine.solve(position, wrench, method=method)
    assert int(solution.status) == sm.Status.CONVERGED
    return solution


def assert_compliance(got: np.ndarray, printed: list[list[float]]) -> None:
    wanted = np.array(printed) * LENGTH[:, None] / FORCE[None, :]
    size = np.sqrt(np.diagonal(wanted))
    assert np.abs((got - wanted) / np.outer(size, size)).max() < 1e-8


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c['pose_mm']} {c['wrench_N'][:3]}")
def test_displacement(orthoglide: sm.Machine, case: dict[str, Any], method: str) -> None:
    got = solve(orthoglide, case, method).displacement
    wanted = np.array(case["displacement"]) * LENGTH
    for part, floor in ((slice(0, 3), 1e-14), (slice(3, 6), 1e-13)):
        tolerance = 1e-8 * np.abs(wanted[part]).max() + floor
        assert np.abs(got[part] - wanted[part]).max() < tolerance


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c['pose_mm']} {c['wrench_N'][:3]}")
def test_loaded_compliance(orthoglide: sm.Machine, case: dict[str, Any], method: str) -> None:
    assert_compliance(solve(orthoglide, case, method).compliance, case["loaded_compliance"])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", DATA["cases"][::3], ids=lambda c: str(c["pose_mm"]))
def test_unloaded_compliance(orthoglide: sm.Machine, case: dict[str, Any], method: str) -> None:
    assert_compliance(solve(orthoglide, case, method, loaded=False).compliance, case["unloaded_compliance"])

"""A diagnosis goes on where one of its own trials fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.identification.candidates.candidates import Candidate, candidates, clash
from stiffmap.identification.candidates.sensitivity import STEP, PlanProbe


@pytest.fixture(scope="module")
def tilts() -> list[Candidate]:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=6, seed=1)
    return [c for c in candidates(machine.description, plan) if c.kind == "tilt" and c.element == "actuator"]


def test_one_leg_and_all_legs_clash(tilts: list[Candidate]) -> None:
    legs = [c.legs for c in tilts]
    assert legs == [("x",), ("y",), ("z",), ("x", "y", "z")]
    assert clash(tilts[0], [tilts[3]])
    assert not clash(tilts[0], [tilts[1]])


def test_loads_next_to_buckling_leave_signatures_whole() -> None:
    machine = sm.load_machine("linear-delta")
    at, push = np.array([[-0.1, 0.1, 0.22], [0.0, 0.0, 0.3]]), np.array([[0, 955.0, 0, 0, 0, 0]] * 2)
    more = machine.solve(at, push + [0, STEP, 0, 0, 0, 0])
    assert list(more.status) == [
        sm.Status.UNSTABLE,
        sm.Status.CONVERGED,
    ]  # a little more, and a rod gives way
    plan = replace(
        random_plan(machine, "deflection", poses=2, seed=1).rows(np.arange(2)), position=at, wrench=push
    )
    predictor = Predictor(machine, plan)
    probe = PlanProbe(predictor, predictor())
    expected = np.array(machine.solve(at, push).compliance)[:, :3, :3]
    np.testing.assert_allclose(probe.compliance()[:, :3, :3], expected, atol=1e-3 * np.abs(expected).max())

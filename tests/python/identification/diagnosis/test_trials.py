"""A diagnosis goes on where one of its own trials fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.kept import Kept
from stiffmap.experiment import Predictor, random_plan, simulate
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import Problem, readings_of
from stiffmap.identification.diagnosis.candidates.candidates import Candidate, candidates, clash
from stiffmap.identification.diagnosis.candidates.sensitivity import STEP, PlanProbe, Variant, difference
from stiffmap.identification.diagnosis.candidates.stack import Stack
from stiffmap.identification.diagnosis.fitting.fit import evaluate, fit
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.screen import Screen
from stiffmap.identification.diagnosis.search.selection import Search, additions, backward
from stiffmap.model.description import AppliedEffect

TRUTH = [AppliedEffect("tilt", "actuator", ("x",), (("angle_y", 5e-4), ("angle_z", -4e-4)))]


@pytest.fixture(scope="module")
def tilts() -> list[Candidate]:
    machine = sm.load_machine("orthoglide-revised")
    plan = random_plan(machine, "position", poses=6, seed=1)
    return [c for c in candidates(machine.description, plan) if c.kind == "tilt" and c.element == "actuator"]


@pytest.fixture(scope="module")
def search(tilts: list[Candidate]) -> Search:
    machine = sm.load_machine("orthoglide-revised")
    data = simulate(machine, random_plan(machine, "position", poses=12, seed=1), TRUTH, seed=1)
    predictor = Predictor(machine, data)
    base = predictor()
    problem = Problem.of(data, noise_of(data).sigma, base)
    index = readings_of(data, base)
    variants = [
        Variant(
            c,
            np.stack([difference(c, p, (), predictor, base)[index] for p in c.linear]),
            np.zeros(len(c.linear)),
        )
        for c in tilts
    ]
    return Search(predictor, problem, Screen.of(problem, Stack.of(variants)), 50.0)


def test_one_leg_and_all_legs_clash(tilts: list[Candidate]) -> None:
    legs = [c.legs for c in tilts]
    assert legs == [("x",), ("y",), ("z",), ("x", "y", "z")]
    assert clash(tilts[0], [tilts[3]])
    assert not clash(tilts[0], [tilts[1]])


def test_candidates_that_exclude_each_other_are_not_tried_together(
    search: Search, tilts: list[Candidate]
) -> None:
    model = evaluate(Model((tilts[3],), np.zeros(3)), search.predictor, search.problem)
    assert additions(search, model, 5) == []
    beside_y = evaluate(Model((tilts[1],), np.zeros(3)), search.predictor, search.problem)
    found = [f.model.candidates[-1] for f in additions(search, beside_y, 5)]
    assert tilts[0] in found and tilts[3] not in found


def test_a_failed_fit_ends_nothing(search: Search, tilts: list[Candidate]) -> None:
    both = fit(Model((tilts[0], tilts[3]), np.zeros(6)), search.predictor, search.problem)
    assert not both.usable
    assert "exclude" in both.failure
    assert additions(search, both, 5) == []


def test_bounds_are_part_of_the_fit(search: Search, tilts: list[Candidate]) -> None:
    """From far outside, and where the fit fails, values are within their bounds."""
    for picked in ((tilts[0],), (tilts[0], tilts[3])):
        start = Model(picked, np.full(3 * len(picked), 1e6))
        found = fit(start, search.predictor, search.problem)
        low, high = found.bounds()
        assert np.all((low <= found.values) & (found.values <= high))
        found.terms()


def test_backward_keeps_what_cannot_be_left_out(search: Search, tilts: list[Candidate]) -> None:
    model = fit(Model((tilts[0], tilts[1]), np.zeros(6)), search.predictor, search.problem)

    def broken(terms: tuple[AppliedEffect, ...]) -> np.ndarray:
        if len(terms) == 1:
            raise sm.StiffmapError("cannot be built")
        return search.predictor(terms)

    broken.tangents, broken.effort, broken.patience = Kept(), 0.0, np.inf  # type: ignore[attr-defined]
    hurt = replace(search, predictor=broken)  # type: ignore[arg-type]
    assert backward(hurt, model).candidates == model.candidates


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

"""What is named beside a rest that nothing explains, and what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.candidates.sensitivity import plan_of
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted


def wandering(e: Experiment, size: float, seed: int) -> Floats:
    """(n, 6) m, long waves over the workspace, `size` rms."""
    rng = np.random.default_rng(seed)
    x = (e.position - e.position.mean(0)) / np.ptp(e.position, axis=0)
    waves = np.sin(x @ (4.0 * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    return np.pad(size * waves / np.sqrt(np.mean(waves**2)), ((0, 0), (0, 3)))


def positions(name: str, poses: int, seed: int) -> tuple[sm.Machine, Experiment]:
    machine = sm.load_machine(name)
    return machine, replace(
        random_plan(machine, "position", poses=poses, repeats=2, seed=seed), frame="unknown"
    )


def spring(machine: sm.Machine, stiffness: float, anchor: tuple[float, float, float]) -> sm.Machine:
    x, y, z = anchor
    return machine.with_effect(
        "external_spring", element="tcp", stiffness=stiffness, length=0.3, anchor_x=x, anchor_y=y, anchor_z=z
    )


def drawn(machine: sm.Machine, pulled: sm.Machine, plan: Experiment, scale: float, rest: float) -> Experiment:
    """A machine that something pulls at, its numbers drawn from their uncertainties, and a rest (share of the effect)."""
    rng = np.random.default_rng(4)
    bare, effect = Predictor(machine, plan), Predictor(pulled, plan)
    names = unknowns(machine.description, bare.experiment)
    numbers = predicted(bare, names, scale * rng.standard_normal(len(names))) - bare()
    size = float(np.sqrt(np.nanmean((effect() - bare())[:, :3] ** 2)))
    noise = np.nan_to_num(plan.sigma) * rng.standard_normal(plan.reading.shape)
    reading = effect() + numbers + wandering(plan, rest * size, 5) + noise
    return replace(plan.with_readings(reading), joints=None, other_joints=None)


def test_a_spring_is_named_beside_uncertain_numbers_and_a_rest() -> None:
    machine, plan = positions("ur10", 30, 0)
    data = drawn(machine, spring(machine, 1700.0, (-0.68, -0.15, 0.77)), plan, 0.5, 0.05)
    d = sm.diagnose(machine, data)
    assert d.effects[0].kind == "external_spring"


def test_a_spring_is_named_though_numbers_far_beyond_tolerance_would_show_the_same() -> None:
    machine, plan = positions("orthoglide-revised", 60, 0)
    data = drawn(machine, spring(machine, 1700.0, (0.15, -0.05, 0.54)), plan, 0.5, 0.0)
    d = sm.diagnose(machine, data)
    assert [e.kind for e in d.effects] == ["external_spring"]


def test_no_spring_is_tried_that_pulls_harder_than_a_tool_bears() -> None:
    machine, plan = positions("orthoglide-revised", 6, 3)
    springs = [
        v
        for v in plan_of(Predictor(machine, plan)).variants
        if v.candidate.kind == "external_spring" and v.candidate.element == "tcp"
    ]
    for v in springs:
        (stiffness,) = v.candidate.linear
        shape = dict(v.shape)
        away = np.linalg.norm(plan.position - [shape[f"anchor_{a}"] for a in "xyz"], axis=1)
        pull = v.most * stiffness.scale * np.abs(away - shape["length"])
        np.testing.assert_allclose(pull.max(), 1e4, rtol=1e-3)
    assert len(springs) == 28

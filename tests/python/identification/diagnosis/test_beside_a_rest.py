"""What is named beside a rest that nothing explains, and what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan, simulate
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.calibration import unknowns
from stiffmap.identification.calibration.model import predicted
from stiffmap.identification.diagnosis.decision.beside_calibration import imitated
from stiffmap.identification.diagnosis.decision.beside_field import log_evidence, standing
from stiffmap.identification.diagnosis.decision.stability import explained
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.study import find, study


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
    machine, plan = positions("ur10", 60, 0)
    data = drawn(machine, spring(machine, 1700.0, (-0.68, -0.15, 0.77)), plan, 0.5, 0.05)
    d = sm.diagnose(machine, data)
    assert d.effects[0].kind == "external_spring"


def test_a_spring_is_named_though_numbers_far_beyond_tolerance_would_show_the_same() -> None:
    machine, plan = positions("orthoglide-revised", 60, 0)
    data = drawn(machine, spring(machine, 1700.0, (0.15, -0.05, 0.54)), plan, 0.5, 0.0)
    d = sm.diagnose(machine, data)
    assert [e.kind for e in d.effects] == ["external_spring"]


def test_waves_over_the_workspace_are_no_effect() -> None:
    """Before, a periodic error of the drive: it explains part of any wave."""
    machine, plan = positions("travelling-column", 80, 1)
    twin = simulate(machine, plan, [], seed=12)
    x = (twin.position - twin.position.mean(0)) / np.ptp(twin.position, axis=0)
    rng = np.random.default_rng(14)
    size = 1e-3 * 10.0 ** rng.uniform(-1.0, 0.5)
    waves = np.sin(x @ (rng.uniform(2.0, 12.0) * rng.standard_normal((3, 3))) + rng.uniform(0.0, 6.0, 3))
    data = twin.with_readings(twin.reading + np.pad(size * waves, ((0, 0), (0, 3))))
    d = sm.diagnose(machine, replace(data, joints=None))
    assert d.verdict == "unattributed"
    assert any("smooth field" in why for why in d.refused)


def test_an_effect_that_is_there_stands_beside_the_field() -> None:
    machine, plan = positions("travelling-column", 40, 1)
    bent = machine.with_effect("periodic_error", element="head_drive", amplitude=1e-4, period=0.1, phase=1.0)
    twin = simulate(bent, plan, [], seed=2)
    data = twin.with_readings(twin.reading + wandering(plan, 2e-5, 3))
    s = study(Predictor(machine, replace(data, joints=None)), 0)
    finding = find(s)
    assert "periodic_error" in [c.kind for c in finding.model.candidates]
    model, _ = standing(s, finding)
    assert [c.kind for c in model.candidates] == ["periodic_error"]
    left = s.free(s.experiment.reading - s.plan.base, finding.outliers)
    with_it, without = (log_evidence(s, m, finding.outliers, left) for m in (model, Model()))
    assert with_it > without + 20.0


def test_numbers_imitate_only_within_their_tolerances() -> None:
    columns = np.eye(40)[:, :4] * 50.0
    assert imitated(columns, columns @ np.array([1.0, -1.0, 0.5, 1.5]))
    assert not imitated(
        columns, columns @ np.array([20.0, -1.0, 0.5, 1.5])
    )  # all of it, but 20 uncertainties off
    assert not imitated(columns, np.eye(40)[:, 10] * 50.0)


@pytest.mark.parametrize(
    ("before", "after", "freedom", "share"), [(500, 100, 100, 1.0), (500, 300, 100, 0.5), (90, 45, 100, 1.0)]
)
def test_the_share_explained_is_at_most_all(before: float, after: float, freedom: int, share: float) -> None:
    assert explained(Model(chi2=before), Model(chi2=after), freedom) == pytest.approx(share)

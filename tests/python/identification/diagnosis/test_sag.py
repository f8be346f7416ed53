"""An arm whose file has no weights sags all the same: that is said, and takes no other name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.python.experiment.readings import test_length
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.virtual.plans import with_distances
from stiffmap.identification.diagnosis import Diagnosis
from stiffmap.identification.diagnosis.report.sentences import next_step
from stiffmap.identification.inference import kernels, names
from stiffmap.identification.inference.columns import Columns
from stiffmap.model.description import Body, Joint
from stiffmap.model.description.tree import Elements, edit_all, edit_sequences

NOISE = 2e-5


def rigid_and_weightless(machine: sm.Machine, *, weightless: bool = True) -> sm.Machine:
    """The arm as a table of its lengths gives it; or with its weights."""

    def bare(sequence: Elements) -> Elements:
        kept = (e for e in sequence if not (weightless and isinstance(e, Body)))
        return tuple(replace(e, law=None) if isinstance(e, Joint) else e for e in kept)

    return sm.Machine(edit_all(machine.description, lambda elements, name: edit_sequences(elements, bare)))


@pytest.fixture(scope="module")
def arm() -> tuple[sm.Machine, sm.Machine, Experiment]:
    """The real arm, its declared file, and poses that it is commanded to by its joints."""
    heavy = sm.load_machine("ur10")
    declared = rigid_and_weightless(heavy)
    rng = np.random.default_rng(3)
    joints = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-0.6, 0.6, (40, 6))
    return heavy, declared, replace(plan_of_joints(declared, joints, noise=NOISE), frame="unknown")


def found(declared: sm.Machine, plan: Experiment, exact: Floats) -> Diagnosis:
    noise = NOISE * np.random.default_rng(4).standard_normal(exact.shape)
    return sm.diagnose(declared, plan.with_readings(exact + noise), cross_validate=False)


def test_a_kernel_of_sag_is_what_drives_show_that_yield_by_the_rise_of_the_tool(
    arm: tuple[sm.Machine, sm.Machine, Experiment],
) -> None:
    _, declared, plan = arm
    rows, channel = np.nonzero(plan.read)
    points = kernels.ReadingPoints(rows, channel, np.full(len(rows), NOISE))
    kernel = next(k for k in kernels.gaps(declared, plan, points) if k.name == kernels.SAG)
    assert plan.joints is not None
    step, whole = 1e-5, np.zeros((len(points), len(points)))
    for unit in step * np.eye(6):
        ends = [
            sm.forward_kinematics(declared, plan.joints + s * unit, start=plan.joints).position
            for s in (1, -1)
        ]
        moved = (ends[0] - ends[1]) / (2 * step)
        shown = (moved * moved[:, 2:])[rows, channel] / NOISE
        whole += np.outer(shown, shown)
    assert kernel.between(points, points) == pytest.approx(whole, abs=1e-6 * np.abs(whole).max())


def test_sag_of_an_arm_without_weights_is_said_and_takes_no_other_name(
    arm: tuple[sm.Machine, sm.Machine, Experiment],
) -> None:
    heavy, declared, plan = arm
    d = found(declared, plan, Predictor(heavy, replace(plan, gravity=(0.0, 0.0, -9.81)))())
    assert d.verdict == "unattributed" and not d.effects
    assert d.unexplained[0].what == kernels.SAG and d.unexplained[0].share > 0.8
    assert "masses of the links" in next_step(d)
    assert d.after.rms < 0.5 * d.before.rms  # numbers of the file take what they can of it


def test_sag_that_is_not_worth_a_name_is_left_out(
    arm: tuple[sm.Machine, sm.Machine, Experiment], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, declared, plan = arm
    search, given = names.searched, list[Columns]()
    monkeypatch.setattr(names, "searched", lambda c, *a, **k: given.append(c) or search(c, *a, **k))
    assert found(declared, plan, Predictor(declared, plan)()).verdict == "none"
    assert kernels.SAG in [name for _, name, _ in given[0].gaps]
    worlds = names._worlds(given[0], None, lambda: False, False)
    assert kernels.SAG not in [g.name for w in worlds for g in w.gaps]


def test_a_lead_error_of_that_arm_keeps_its_name(arm: tuple[sm.Machine, sm.Machine, Experiment]) -> None:
    _, declared, plan = arm
    off = declared.with_effect("lead_error", element="shoulder", slope=1e-3)
    d = found(declared, plan, Predictor(off, plan)())
    assert [e.kind for e in d.effects] == ["lead_error"] and not d.unexplained


def test_sag_of_lengths_is_their_slope(tmp_path: Path) -> None:
    declared = rigid_and_weightless(sm.load_machine("ur10"))
    q, length = test_length.drawn(declared, 40, np.zeros(6))
    predictor = Predictor(declared, load_experiment(test_length.write(tmp_path / "e", q, length)))
    e = predictor.experiment
    rows, channel = np.nonzero(e.read)
    points = kernels.ReadingPoints(rows, channel, np.full(len(rows), NOISE))
    kernel = next(k for k in kernels.gaps(predictor.machine, e, points) if k.name == kernels.SAG)
    expected, step = np.zeros(len(q)), 1e-5
    for unit in step * np.eye(6):
        up, down = (sm.forward_kinematics(declared, q + s * unit, start=q) for s in (1, -1))
        to = [
            np.linalg.norm(p.position + p.rotation @ test_length.SPOT - test_length.ANCHORS[rows % 2], axis=1)
            for p in (up, down)
        ]
        rise = (up.position - down.position)[:, 2] / (2 * step)
        expected += ((to[0] - to[1]) / (2 * step) * rise / NOISE) ** 2
    assert kernel.own(points) == pytest.approx(expected, rel=1e-3)


def test_readings_between_two_poses_have_none(arm: tuple[sm.Machine, sm.Machine, Experiment]) -> None:
    _, declared, plan = arm
    e = Predictor(declared, with_distances(replace(plan, frame="known"), NOISE)).experiment
    assert found(declared, e, Predictor(declared, e)()).verdict == "none"


def sag(machine: sm.Machine) -> float:
    """Mean variance of the kernel, 0 without one."""
    plan = Predictor(machine, sm.experiment.random_plan(machine, "position", poses=8, seed=1)).experiment
    rows, channel = np.nonzero(plan.read)
    points = kernels.ReadingPoints(rows, channel, np.full(len(rows), NOISE))
    return sum(
        float(k.own(points).mean()) for k in kernels.gaps(machine, plan, points) if k.name == kernels.SAG
    )


@pytest.mark.parametrize("name", ["ur10", "rotary-delta"])
def test_sag_that_the_file_has_is_no_gap(name: str) -> None:
    assert sag(sm.load_machine(name)) == 0.0


def test_slides_do_not_sag_along_their_travel() -> None:
    assert sag(rigid_and_weightless(sm.load_machine("ur10"))) > 0.0
    assert sag(rigid_and_weightless(sm.load_machine("ur10"), weightless=False)) > 0.0
    assert sag(rigid_and_weightless(sm.load_machine("travelling-column"))) == 0.0

"""An arm whose file has no weights sags all the same: that is said, and takes no other name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis import Diagnosis
from stiffmap.identification.diagnosis.report.sentences import next_step
from stiffmap.identification.inference import kernels
from stiffmap.model.description import Body, Joint
from stiffmap.model.description.tree import Elements, edit_all, edit_sequences

NOISE = 2e-5


def rigid_and_weightless(machine: sm.Machine) -> sm.Machine:
    """The arm as a table of its lengths gives it."""

    def bare(sequence: Elements) -> Elements:
        kept = (e for e in sequence if not isinstance(e, Body))
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


def test_a_lead_error_of_that_arm_keeps_its_name(arm: tuple[sm.Machine, sm.Machine, Experiment]) -> None:
    _, declared, plan = arm
    off = declared.with_effect("lead_error", element="shoulder", slope=1e-3)
    d = found(declared, plan, Predictor(off, plan)())
    assert [e.kind for e in d.effects] == ["lead_error"] and not d.unexplained


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
    assert sag(rigid_and_weightless(sm.load_machine("travelling-column"))) == 0.0

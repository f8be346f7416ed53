"""An arm whose file has no weights sags all the same: its drives do so then by a number, which takes no other name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.virtual.plans import with_distances
from stiffmap.identification.candidates.sensitivity import CandidatePlan
from stiffmap.identification.diagnosis import Diagnosis
from stiffmap.identification.diagnosis.report.sentences import next_step
from stiffmap.identification.inference import names
from stiffmap.identification.inference.columns import Columns, columns
from stiffmap.identification.inference.parts import ALL_NUMBERS, Parts
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.unknowns import SAG
from stiffmap.model.description import Body, Joint
from stiffmap.model.description.tree import Elements, edit_all, edit_sequences, joints
from stiffmap.model.with_errors import edited

NOISE = 2e-5
Arm = tuple[sm.Machine, sm.Machine, Experiment]


def rigid_and_weightless(machine: sm.Machine, *, weightless: bool = True) -> sm.Machine:
    """The arm as a table of its lengths gives it; or with its weights."""

    def bare(sequence: Elements) -> Elements:
        kept = (e for e in sequence if not (weightless and isinstance(e, Body)))
        return tuple(replace(e, law=None) if isinstance(e, Joint) else e for e in kept)

    return sm.Machine(edit_all(machine.description, lambda elements, name: edit_sequences(elements, bare)))


@pytest.fixture(scope="module")
def arm() -> Arm:
    """The real arm, its declared file, and poses that it is commanded to by its joints."""
    heavy = sm.load_machine("ur10")
    declared = rigid_and_weightless(heavy)
    rng = np.random.default_rng(3)
    q = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-0.6, 0.6, (40, 6))
    return heavy, declared, replace(plan_of_joints(declared, q, noise=NOISE), frame="unknown")


def found(declared: sm.Machine, plan: Experiment, exact: Floats, **options: bool) -> Diagnosis:
    noise = NOISE * np.random.default_rng(4).standard_normal(exact.shape)
    return sm.diagnose(declared, plan.with_readings(exact + noise), **options)


def test_sag_of_an_arm_without_weights_is_named_and_in_the_file(arm: Arm) -> None:
    heavy, declared, plan = arm
    d = found(declared, plan, Predictor(heavy, replace(plan, gravity=(0.0, 0.0, -9.81)))())
    assert d.verdict.startswith("effects") and not d.effects
    assert d.calibration is not None and {n.group for n in d.calibration.beyond} == {SAG}
    assert d.shares[SAG] > 0.8
    assert "every arm sags" in next_step(d)
    assert d.after.rms < 0.2 * d.before.rms
    sags = {name: joint.sag for name, joint in joints(d.machine.description).items()}
    assert min(sags["arm.shoulder"], sags["arm.elbow"]) > 1e-5


def test_sag_is_found_at_its_size(arm: Arm) -> None:
    """Also by lengths that a wire or a ball-bar reads between two poses."""
    _, declared, plan = arm
    real = sm.Machine(
        edited(declared.description, {("arm.shoulder", "sag"): 1e-3, ("arm.elbow", "sag"): 2e-3})
    )
    for read in (plan, with_distances(replace(plan, frame="known"), NOISE)):
        e = Predictor(declared, read).experiment
        d = found(declared, e, Predictor(real, e)(), cross_validate=False)
        assert d.verdict == "effects" and d.calibration is not None
        off = {n.name: n for n in d.calibration.beyond}
        assert set(off) == {"sag of arm.shoulder", "sag of arm.elbow"}
        for name, size in (("shoulder", 1e-3), ("elbow", 2e-3)):
            n = off[f"sag of arm.{name}"]
            assert n.value == pytest.approx(size, rel=0.1) and abs(n.value - size) < 4 * n.sigma


def test_sag_that_is_not_worth_a_name_is_left_out(arm: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    _, declared, plan = arm
    search, given = names.searched, list[Columns]()
    monkeypatch.setattr(names, "searched", lambda c, *a, **k: given.append(c) or search(c, *a, **k))
    assert found(declared, plan, Predictor(declared, plan)()).verdict == "none"
    assert SAG not in given[0].groups


def test_sag_has_a_size_of_its_own_next_to_all_other_numbers(arm: Arm) -> None:
    _, declared, plan = arm
    predictor = Predictor(declared, plan)
    numbers = unknowns(declared.description, plan)
    c = columns(predictor, CandidatePlan(predictor(), (), ()), np.full(plan.reading.shape, NOISE), numbers)
    shared, own = Parts(c).together
    assert (shared.name, own.name) == (ALL_NUMBERS, SAG)
    assert shared.factor is not None and own.factor is not None
    assert [shared.factor.shape[1], own.factor.shape[1]] == [
        len(c.unknowns) - len(c.groups[SAG]),
        len(c.groups[SAG]),
    ]


def test_a_lead_error_of_that_arm_keeps_its_name(arm: Arm) -> None:
    _, declared, plan = arm
    off = declared.with_effect("lead_error", element="shoulder", slope=1e-3)
    d = found(declared, plan, Predictor(off, plan)(), cross_validate=False)
    assert [e.kind for e in d.effects] == ["lead_error"] and not d.unexplained


def test_readings_between_two_poses_have_none(arm: Arm) -> None:
    _, declared, plan = arm
    e = Predictor(declared, with_distances(replace(plan, frame="known"), NOISE)).experiment
    assert found(declared, e, Predictor(declared, e)(), cross_validate=False).verdict == "none"


@pytest.mark.parametrize(
    ("machine", "count"),
    [
        (sm.load_machine("ur10"), 0),
        (sm.load_machine("rotary-delta"), 0),
        (rigid_and_weightless(sm.load_machine("travelling-column")), 0),
        (rigid_and_weightless(sm.load_machine("ur10")), 6),
        (rigid_and_weightless(sm.load_machine("ur10"), weightless=False), 6),
    ],
    ids=["weighs", "loops", "slides", "weightless", "rigid"],
)
def test_which_drives_may_sag(machine: sm.Machine, count: int) -> None:
    plan = sm.experiment.random_plan(machine, "position", poses=8, seed=1)
    assert sum(u.group == SAG for u in unknowns(machine.description, plan)) == count


def test_a_leg_with_loops_and_deflections_have_none() -> None:
    delta, arm = (rigid_and_weightless(sm.load_machine(name)) for name in ("rotary-delta", "ur10"))
    leg = replace(delta.description, legs=delta.description.legs[:1])
    for description, quantity in ((leg, "position"), (arm.description, "deflection")):
        plan = sm.experiment.random_plan(arm, quantity, poses=8, seed=1)
        assert not [u.name for u in unknowns(description, plan) if u.group == SAG]

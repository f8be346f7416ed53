"""Poses that the fast path does not close keep where the joints stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.status import Flag

ARM = np.array([0.3, -1.2, 1.4, -1.0, 1.2, 0.2])
"""rad: the wrist turned over against that of home."""


def test_variants_in_another_branch_than_home_start_where_the_joints_stand() -> None:
    machine = sm.load_machine("ur10")
    joints = ARM + np.random.default_rng(1).uniform(-0.2, 0.2, (4, 6))
    at = sm.forward_kinematics(machine, joints)
    e = random_plan(machine, "deflection", poses=4, seed=1)
    e = e.rows(np.arange(8))
    rows = np.repeat(np.arange(4), 2)
    e = replace(e, position=np.array(at.position)[rows], rotation=np.array(at.rotation)[rows])
    plain = machine.solve(e.position, e.wrench, rotation=e.rotation)
    assert (plain.flags & Flag.REFERENCE_PATH).all()
    predictor = Predictor(machine, e)
    near = predictor.experiment.near
    assert near is not None
    there = machine.solve(e.position, e.wrench, rotation=e.rotation, start=near)
    assert not there.reference_share
    soft = AppliedEffect("compliance", "shoulder", ("arm",), (("scale", 3.0),))
    softer = machine.with_effect("compliance", element="shoulder", legs=["arm"], scale=3.0)
    loaded, free = (
        softer.solve(e.position, w, rotation=e.rotation).displacement for w in (e.wrench, 0.0 * e.wrench)
    )
    np.testing.assert_allclose(predictor([soft]), loaded - free, rtol=0, atol=1e-12)


def test_poses_on_the_fast_path_are_closed_anew() -> None:
    machine = sm.load_machine("orthoglide-revised").with_effect(
        "dead_zone", element="actuator", legs=["y"], half_width=1e-5
    )
    assert Predictor(machine, random_plan(machine, "deflection", poses=4, seed=1)).experiment.near is None

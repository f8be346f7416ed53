"""Tap tests: modes paired by direction, the effect that explains them, statics beside them, bad tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment.virtual.plans import random_plan
from stiffmap.identification.taps import TapTest, explain_taps, load_taps, predict_taps
from stiffmap.workspace.vibration import tip_modes

EXAMPLE = Path(__file__).parents[4] / "examples/taps"
POSES = np.array([[1.98, -0.28, 1.225], [1.7, 0.4, 1.4], [1.9, 0.0, 1.0]])


@pytest.fixture(scope="module")
def arm():
    return sm.load_machine(EXAMPLE / "kr210.yaml")


def tapped(machine, seed=None, count=4, noise=0.005):
    """Modes of a machine as a modal program would list them; seed: None without noise."""
    modes = tip_modes(machine, POSES)
    rng = np.random.default_rng(seed)
    rows = []
    for k, p in enumerate(POSES):
        for j in range(count):
            b, f = modes.tip[k, :3, j], modes.frequency[k, j]
            b = b / np.linalg.norm(b) + (0.05 * rng.normal(size=3) if seed is not None else 0)
            rows.append(
                [*p, f * (1 + (noise * rng.normal() if seed is not None else 0)), *(b / np.linalg.norm(b))]
            )
    r = np.array(rows)
    return TapTest(r[:, :3], r[:, 3], noise * r[:, 3], np.full(len(r), np.nan), r[:, 4:])


def soft(machine, element="a2", scale=1.8):
    return machine.with_effect("compliance", element=element, legs=["arm"], scale=scale)


def test_the_example_names_the_soft_joint_that_mujoco_played(arm):
    found = explain_taps(arm, load_taps(EXAMPLE / "taps.csv"))
    assert found.named is not None and found.named.candidate == "compliance of a2, leg arm"
    scale, u = found.named.parameters["scale"], found.named.u["scale"]
    assert abs(scale - 1.8) < 3 * u < 0.3
    assert found.before > 100 and found.named.chi2 < 30
    # held out: the response of a pose that was not tapped, against the machine that was
    p, f = [1.6, -0.5, 1.2], np.linspace(4, 30, 80)
    true, before, after = (
        np.abs(sm.frequency_response(m, p, f, damping=0.03).values[:, :3, :3])
        for m in (soft(arm), arm, found.named.machine)
    )
    assert np.abs(after - true).max() < 0.25 * np.abs(before - true).max()


def test_noise_alone_gets_no_cause(arm):
    for seed in range(3):
        found = explain_taps(arm, tapped(arm, seed))
        assert found.named is None and found.alike == () and "Nothing is missing" in found.sentence


def test_a_load_on_the_tool_is_a_mass(arm):
    from stiffmap.model.description import Body

    d = arm.description
    heavy = sm.Machine(replace(d, platform=(*d.platform, Body("gripper", 60.0))))
    found = explain_taps(arm, tapped(heavy, 2))
    names = [e.candidate for e in found.alike]
    assert "payload of platform" in names
    best = next(e for e in found.alike if e.candidate == "payload of platform")
    assert best.parameters["mass"] == pytest.approx(60.0, abs=4 * best.u["mass"])


def test_modes_that_cross_are_paired_by_direction(arm):
    """The second joint is so soft that its mode goes below that of the first: each row keeps its own."""
    crossed = soft(arm)
    found = predict_taps(crossed, tapped(arm))
    own = tip_modes(crossed, POSES[:1])
    way = own.tip[0, :3, :4] / np.linalg.norm(own.tip[0, :3, :4], axis=0)
    rows = tapped(arm)
    pick = [int(np.argmax((rows.direction[i] @ way) ** 2)) for i in range(4)]
    assert len(set(pick)) == 4 and pick != [0, 1, 2, 3]
    np.testing.assert_allclose(found.frequency[:4], own.frequency[0, pick])
    assert (found.mac[:4] > 0.8).all()


@pytest.mark.parametrize(("static_scale", "agree"), [(1.8, True), (2.6, False)])
def test_statics_and_frequencies_must_say_the_same(arm, static_scale, agree):
    """Deflections of a joint that creeps more at rest than it yields when tapped: a disagreement is the answer."""
    plan = random_plan(arm, poses=4, loads=3, repeats=1, noise=5e-6, seed=3)
    statics = sm.simulate(soft(arm, scale=static_scale), plan, seed=4)
    found = explain_taps(arm, tapped(soft(arm), 5), statics, only=["compliance"])
    best = found.alike[0]
    assert best.candidate == "compliance of a2, leg arm"
    assert best.statics == pytest.approx(static_scale, rel=0.05) and best.taps == pytest.approx(1.8, rel=0.08)
    assert ("agree (" in found.sentence) is agree and ("disagree by" in found.sentence) is not agree


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_mm,y_mm,z_mm\n1,2,3\n", "missing frequency_Hz"),
        ("x_mm,y_mm,z_mm,frequency_Hz,tone\n1,2,3,4,5\n", "unknown column 'tone'"),
        (
            "x_mm,y_mm,z_mm,frequency_Hz\n1,2,3,-4\n",
            "line 2.*frequency_Hz: expected a number above zero, found -4",
        ),
        ("x_mm,y_mm,z_mm,frequency_Hz\n1,2,3,low\n", "frequency_Hz: expected a number, found 'low'"),
        ("x_mm,y_mm,z_mm,frequency_Hz,u_Hz\n1,2,3,9,0\n", "u_Hz: expected a number above zero"),
        ("x_mm,y_mm,z_mm,frequency_Hz\n1,2,3\n", "expected 4 values, found 3"),
        ("", "the file is empty"),
        ("x_mm,y_mm,z_mm,frequency_rad_s\n1,2,3,60\n", "expected a unit such as in frequency_Hz, found rad"),
        ("# by hand\nx_mm,y_mm,z_mm,frequency_Hz\n1,2,3,9\n\n1,2,3,-9\n", "line 5.*found -9"),
    ],
)
def test_bad_tables_are_one_message(tmp_path, text, message):
    path = tmp_path / "taps.csv"
    path.write_text(text)
    with pytest.raises(sm.StiffmapError, match=message):
        load_taps(path)


def test_poses_out_of_reach_are_said(arm):
    far = tapped(arm)
    with pytest.raises(sm.StiffmapError, match="no pose of the tap test can be reached"):
        predict_taps(arm, TapTest(far.position + 50.0, far.frequency, far.u, far.ratio, far.direction))


def test_poses_to_tap_are_chosen_one_by_one(arm):
    from stiffmap.identification.taps import where_to_tap

    chosen = where_to_tap(arm, 2, tries=12, seed=3)
    assert chosen.shape == (2, 3) and not np.allclose(*chosen)
    low, high = arm.workspace
    assert ((chosen >= low) & (chosen <= high)).all()
    np.testing.assert_array_equal(where_to_tap(arm, 1, tries=12, seed=3)[0], chosen[0])
    with pytest.raises(sm.StiffmapError, match="at most 2 poses"):
        where_to_tap(arm, 3, tries=2)


def test_information_of_poses_is_that_of_the_inverse_covariance():
    from stiffmap.identification.planning.information import information_of

    rng = np.random.default_rng(0)
    A, J, rows = rng.normal(size=(6, 2)), rng.normal(size=(6, 3)), np.array([1, 1, 0, 1, 1, 0], bool)
    both = np.hstack([A, J])[rows]
    joint = np.linalg.inv(np.eye(5) + both.T @ both)[:2, :2]
    every = np.hstack([A, J])
    assert information_of(both.T @ both, 2, 1.0) == pytest.approx(-np.log(np.linalg.det(joint)), rel=1e-12)
    assert information_of(every.T @ every, 2, 1.0) > information_of(both.T @ both, 2, 1.0)

"""Tap tests: modes paired by direction, the effect that explains them, statics beside them, bad tables."""

from __future__ import annotations

import sys
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
    (named,) = found.named
    assert named.candidate == "compliance of a2, leg arm" and not named.alike and found.fits
    assert abs(named.value - 1.8) < 3 * named.u["scale"] < 0.3
    assert found.before > 100 and named.chi2 < 30
    # held out: the response of a pose that was not tapped, against the machine that was
    p, f = [1.6, -0.5, 1.2], np.linspace(4, 30, 80)
    true, before, after = (
        np.abs(sm.frequency_response(m, p, f, damping=0.03).values[:, :3, :3])
        for m in (soft(arm), arm, found.machine)
    )
    assert np.abs(after - true).max() < 0.25 * np.abs(before - true).max()


def test_noise_alone_gets_no_cause(arm):
    for seed in range(3):
        found = explain_taps(arm, tapped(arm, seed))
        assert found.named == () and found.fits and "Nothing is missing" in found.sentence


def test_a_load_on_the_tool_is_a_mass(arm):
    from stiffmap.model.description import Body

    d = arm.description
    heavy = sm.Machine(replace(d, platform=(*d.platform, Body("gripper", 60.0))))
    found = explain_taps(arm, tapped(heavy, 2))
    (named,) = found.named
    best = next(e for e in (named, *named.alike) if e.candidate == "payload of platform")
    assert best.value == pytest.approx(60.0, abs=4 * best.u["mass"])


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
    best = found.named[0]
    assert best.candidate == "compliance of a2, leg arm"
    assert best.statics == pytest.approx(static_scale, rel=0.05) and best.taps == pytest.approx(1.8, rel=0.08)
    assert ("agree (" in found.sentence) is agree and ("disagree by" in found.sentence) is not agree


def test_a_quality_factor_is_a_damping_and_a_mac_says_nothing(tmp_path):
    path = tmp_path / "taps.csv"
    path.write_text("x_mm,y_mm,z_mm,frequency_Hz,Q,MAC,Temp [°C]\n1,2,3,40,16,0.98,21\n1,2,3,95,20,0.9,21\n")
    with pytest.warns(UserWarning, match=r"left out: MAC, Temp \[°C\]"):
        np.testing.assert_allclose(load_taps(path).ratio, [1 / 32, 1 / 40])


MODES = {(1500, 0, 1200): [(9.1, 2.1), (11.2, 1.8)], (1800, 300, 1000): [(8.9, 2.0), (10.9, 1.9)]}
ROWS = [(*p, f, d) for p, modes in MODES.items() for f, d in modes]
TABLES = {
    "titles": "\n".join(
        f"Pose {k}: X = {p[0]} mm, Y = {p[1]} mm, Z = {p[2]} mm\nMode,Frequency [Hz],Damping [%]\n"
        + "".join(f"{j},{f},{d}\n" for j, (f, d) in enumerate(modes, 1))
        for k, (p, modes) in enumerate(MODES.items(), 1)
    ),
    "side by side": "Pose;X [mm];Y [mm];Z [mm];f1 [Hz];f2 [Hz];D1 [%];D2 [%]\n"
    + "".join(f"P1;{p[0]};{p[1]};{p[2]};{a};{b};{c};{d}\n" for p, ((a, c), (b, d)) in MODES.items()),
    "loss factor": "x_mm,y_mm,z_mm,omega (rad/s),loss factor\n"
    + "".join(f"{x},{y},{z},{2 * np.pi * f!r},{d / 50!r}\n" for x, y, z, f, d in ROWS),
    "words": "TCP X,TCP Y,TCP Z,Resonance,Modal damping,Modal mass,Remarks\nmm,mm,mm,Hz,%,kg,\n"
    + "".join(f"{x},{y},{z},{f},{d},100,ok\n" for x, y, z, f, d in ROWS),
}


@pytest.mark.filterwarnings("ignore:.*(stands in the titles|Modal mass)")
@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_tables_as_modal_programs_write_them(tmp_path, text):
    (tmp_path / "taps.csv").write_text(text)
    found = load_taps(tmp_path / "taps.csv")
    rows = np.column_stack([1e3 * found.position, found.frequency, 1e2 * found.ratio])
    np.testing.assert_allclose(rows, ROWS, rtol=1e-12)


def test_a_title_that_lacks_a_coordinate_is_refused(tmp_path):
    (tmp_path / "taps.csv").write_text(TABLES["titles"].replace(", Y = 300 mm", ""))
    with pytest.raises(sm.StiffmapError, match=r"line 8: no title above this row says 'Y \[mm\]'"):
        load_taps(tmp_path / "taps.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "x_mm,y_mm,z_mm,frequency_Hz,Q,damping_percent\n1,2,3,4,5,6\n",
            "expected the damping once, found it as 'damping_percent'",
        ),
        ("x_mm,y_mm,z_mm\n1,2,3\n", "missing frequency_Hz"),
        ("x_mm,y_mm,z_mm,frequency_Hz,tone\n1,2,3,4,5\n", "unknown column 'tone'"),
        (
            "x_mm,y_mm,z_mm,frequency_Hz\n1,2,3,-4\n",
            "line 2.*frequency_Hz: expected a number above zero, found -4",
        ),
        ("x_mm,y_mm,z_mm,frequency_Hz\n1,2,3,low\n", "column 'frequency_Hz': expected a number; found 'low'"),
        ("x_mm,y_mm,z_mm,frequency_Hz,u_Hz\n1,2,3,9,0\n", "u_Hz: expected a number above zero"),
        (
            "x_mm,y_mm,z_mm,frequency_Hz,damping_percent\n1,2,3,9,0\n1,2,3,9,0.02\n",
            "line 3.*a ratio of 0.02 is 2 %",
        ),
        ("x_mm,y_mm,z_mm,frequency_Hz\n1,2,3\n", "expected 4 values, found 3"),
        ("", "the file is empty"),
        ("x_mm,y_mm,z_mm,frequency_rad\n1,2,3,60\n", "expected a unit such as in frequency_Hz, found rad"),
        ("# by hand\nx_mm,y_mm,z_mm,frequency_Hz\n1,2,3,9\n\n1,2,3,-9\n", "line 5.*found -9"),
    ],
)
def test_bad_tables_are_one_message(tmp_path, text, message):
    path = tmp_path / "taps.csv"
    path.write_text(text)
    with pytest.raises(sm.StiffmapError, match=message):
        load_taps(path)


@pytest.mark.parametrize(
    ("unit", "size"),
    [("Hz", 1), ("kHz", 1e-3), ("rpm", 60), ("1/min", 60), ("rad/s", 2 * np.pi), ("krpm", 0.06)],
)
def test_frequencies_have_the_units_of_responses(tmp_path, unit, size):
    path = tmp_path / "taps.csv"
    path.write_text(f"x_mm,y_mm,z_mm,frequency [{unit}],u [{unit}]\n1,2,3,{12 * size!r},{size!r}\n")
    found = load_taps(path)
    np.testing.assert_allclose([found.frequency[0], found.u[0]], [12, 1])


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


def test_information_of_a_pose_is_that_of_its_own_modes(arm, monkeypatch):
    """Squares of what each joint's compliance moves the frequencies there by, over their noise; no more directions than modes."""
    from stiffmap.identification.taps import plan

    seen = []

    def spy(matrices, *rest):
        seen.append(matrices)
        return [0]

    monkeypatch.setattr(plan, "exchange", spy)
    plan.where_to_tap(arm, 1, modes=2, tries=3, seed=1)
    (found,) = seen
    assert [np.linalg.matrix_rank(m, tol=1e-9 * np.trace(m)) for m in found] == [2, 2, 2]
    low, high = arm.workspace
    p = np.random.default_rng(1).uniform(low, high, (3, 3))
    before = np.log(tip_modes(arm, p).frequency[:, :2])
    diagonal = found.diagonal(axis1=1, axis2=2)
    for joint in ("a1", "a2", "a3"):
        after = np.log(tip_modes(soft(arm, joint, np.exp(plan.STEP)), p).frequency[:, :2])
        expected = (((after - before) / plan.STEP / plan.NOISE) ** 2).sum(axis=1)
        assert np.isclose(diagonal, expected[:, None], rtol=1e-6).all(axis=0).any(), joint


@pytest.mark.parametrize("factor", [0.4, 3.0])
def test_assumed_damping_is_off_as_a_whole_and_from_mode_to_mode(arm, factor):
    """Where none is declared the level is uncertain by a factor e and each mode by e^0.5: generalised least squares by hand."""
    from stiffmap.identification.taps.fit import fitted
    from stiffmap.identification.taps.problem import TapsProblem
    from stiffmap.workspace.vibration.modes import ASSUMED

    plain = tapped(arm)
    ratio = np.full(len(plain), factor * ASSUMED)
    problem = TapsProblem(arm, replace(plain, ratio=ratio, u_ratio=0.2 * ratio), None, 0.05)
    each, n = 0.2**2 + 0.5**2 + ratio[0] ** 2, len(plain)
    assert fitted(problem, ()).chi2 == pytest.approx(np.log(factor) ** 2 / (each / n + 1.0), rel=1e-3)


@pytest.mark.parametrize("together", [False, True])
def test_a_perfect_response_is_as_uncertain_as_taps_repeat(tmp_path, together):
    """Two modes without noise: frequency 0.2 %, damping 10 %, flexibility 5 % of the mode and 1 % of the largest (root of squares)."""
    f = np.linspace(20, 60, 400)
    modes = [(30.0, 0.02, np.array([3e-6, -4e-6, 0.0])), (45.0, 0.03, np.array([0.0, 1e-7, 0.0]))]
    rows = ["x_mm,y_mm,z_mm,response,along,hammer"]
    for a in range(3):
        H = sum(
            b[a] / (1 - (f / own) ** 2 + 2j * z * f / own) for own, z, b in modes
        ) + 1e-12 * np.random.default_rng(a).normal(size=f.size)
        lines = [f"{x},{h.real},{h.imag}" for x, h in zip(f.tolist(), H.tolist(), strict=True)]
        (tmp_path / f"{a}.csv").write_text("\n".join(["frequency_Hz,real_m/N,imag_m/N", *lines]) + "\n")
        rows.append(f"1000,0,0,{a}.csv,+{'xyz'[a]},-z")
    if together:
        each = [(tmp_path / f"{a}.csv").read_text().splitlines() for a in range(3)]
        (tmp_path / "all.csv").write_text("\n".join(map(",".join, zip(*each, strict=True))))
        rows[1:] = ["1000,0,0,all.csv,+x y +z,-z"]
    (tmp_path / "taps.csv").write_text("\n".join(rows) + "\n")
    t = load_taps(tmp_path / "taps.csv")
    size = [5e-6, 1e-7]
    assert t.frequency == pytest.approx([30.0, 45.0], rel=1e-4)
    assert t.u == pytest.approx(0.002 * t.frequency, rel=0.02)
    assert t.u_ratio == pytest.approx(0.1 * t.ratio, rel=0.02)
    expected = np.hypot(0.05 * np.array(size), 0.01 * max(size))
    np.testing.assert_allclose(t.u_flexibility, np.repeat(expected[:, None], 3, axis=1), rtol=0.02)
    np.testing.assert_array_equal(t.hammer, [[0, 0, -1]] * 2)
    np.testing.assert_allclose(t.direction[0], [0.6, -0.8, 0.0], atol=1e-4)


@pytest.mark.parametrize(("one", "two"), [(("a2", 1.8), ("a3", 2.5)), (("a1", 1.5), ("a4", 4.0))])
def test_two_soft_joints_are_both_named(arm, monkeypatch, one, two):
    more = [[1.5, -0.5, 1.6], [1.6, 0.6, 0.9], [2.1, 0.1, 1.5]]
    monkeypatch.setattr(sys.modules[__name__], "POSES", np.vstack([POSES, more]))
    found = explain_taps(arm, tapped(soft(soft(arm, *one), *two), 3, count=5))
    assert {e.place.element: e.place.kind for e in found.named} == {n: "compliance" for n, _ in (one, two)}
    for e in found.named:
        true = dict([one, two])[e.place.element]
        assert e.value == pytest.approx(true, abs=4 * e.u["scale"]) and e.u["scale"] < 0.05 * true
    assert found.fits and not any(e.alike for e in found.named)


@pytest.mark.parametrize("seed", [11])
def test_numbers_off_that_pair_other_modes_are_no_cause(seed):
    """Masses that are off by their uncertainty: from the declared ones the fit without causes ends where other modes are paired."""
    from stiffmap.identification.taps.fit import fitted
    from stiffmap.identification.taps.problem import TapsProblem, shifted, uncertain_numbers

    machine, rng = sm.load_machine("orthoglide-revised"), np.random.default_rng(seed)
    numbers = uncertain_numbers(machine.description, 0.05)
    off = np.clip(rng.normal(size=len(numbers)), -3, 3)
    low, high = machine.workspace
    places = low + (high - low) * rng.uniform(0.25, 0.75, (4, 3))
    modes = tip_modes(sm.Machine(shifted(machine.description, numbers, off)), places)
    rows = []
    for p, tip, frequency in zip(places, modes.tip, modes.frequency, strict=True):
        for b, f in zip(tip[:3, :5].T, frequency, strict=False):
            b = b / np.linalg.norm(b) + 0.05 * rng.normal(size=3)
            rows.append([*p, f * (1 + 0.005 * rng.normal()), *(b / np.linalg.norm(b))])
    r = np.array(rows)
    taps = TapTest(r[:, :3], r[:, 3], 0.005 * r[:, 3], np.full(len(r), np.nan), r[:, 4:])
    assert fitted(TapsProblem(machine, taps, None, 0.05), ()).chi2 > 60
    found = explain_taps(machine, taps)
    assert found.named == () and found.fits


@pytest.mark.parametrize("factor", [0.5, 2.1, 9.0])
def test_changes_between_predicted_sizes_are_those_of_the_machine(arm, factor):
    """As far as the same modes are paired; what is wrong between two pairings is mended by whole predictions."""
    from stiffmap.identification.taps.fit import fitted, place_of
    from stiffmap.identification.taps.problem import TapsProblem, causes

    alone = tapped(arm, 6, count=1)
    problem = TapsProblem(arm, alone, None, 0.05)
    null = fitted(problem, [])
    a2 = next(c for c in causes(problem) if str(c) == "compliance of a2, leg arm")
    change = problem.residual([(a2, factor)], null.lines.x) - null.lines.residual
    across = [
        np.linalg.norm(change - s.directions @ (s.directions.T @ change)) / np.linalg.norm(change)
        for s in place_of(problem, a2, null, np.eye(len(change))).shapes
    ]
    assert min(across) < 0.02


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("x [mm],y [mm],z [mm],mode,f [Hz],zeta [%]", "10,0,0,1,50,2"),
        ("Mode No.,x [mm],y [mm],z [mm],fn [kHz],zeta [-]", "1,10,0,0,.05,.02"),
        ("x [mm];y [mm];z [mm];Eigenfrequenz [Hz];Dämpfung [%]", "10;0;0;50;2"),
        ("x [mm],y [mm],z [mm],natural frequency [Hz],damping ratio [1]", "10,0,0,50,0.02"),
        ("Serial No,x [mm],y [mm],z [mm],omega [rad/s],Damp (%)", f"4711,10,0,0,{100 * np.pi},2"),
        (
            "x [mm],y [mm],z [mm],f [Hz],Damp [%],Mode Shape X,Mode Shape Y,Mode Shape Z",
            "10,0,0,50,2,0,0,2",
        ),
    ],
)
def test_modes_as_modal_programs_list_them(head, row, tmp_path):
    (tmp_path / "t.csv").write_text(f"{head}\n{row}\n", encoding="utf-8")
    taps = load_taps(tmp_path / "t.csv")
    found = [taps.frequency[0], taps.ratio[0], *taps.position[0], *np.nan_to_num(taps.direction[0], nan=7)]
    way = [0, 0, 1] if "Shape" in head else [7, 7, 7]
    np.testing.assert_allclose(found, [50, 0.02, 0.01, 0, 0, *way])


def test_one_mode_of_a_bare_structure_may_be_damped_by_less_than_a_thousandth(tmp_path):
    (tmp_path / "t.csv").write_text("x_mm,y_mm,z_mm,f_Hz,damping_percent\n1,2,3,9,0.05\n1,2,3,20,0.8\n")
    np.testing.assert_allclose(load_taps(tmp_path / "t.csv").ratio, [0.0005, 0.008])


@pytest.mark.parametrize("wrong", [None, "taps.csv", 3, []])
def test_what_is_no_tap_test_is_refused_by_name(wrong):
    for call in (predict_taps, explain_taps):
        with pytest.raises(sm.StiffmapError, match=r"^taps: expected a TapTest"):
            call("linear-delta", wrong)
    with pytest.raises(sm.StiffmapError, match=r"^(path: expected text or a path|.*no such table)"):
        load_taps(wrong)

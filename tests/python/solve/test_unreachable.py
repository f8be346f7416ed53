"""Why a pose cannot be reached: against the lengths of the machines."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.unreachable import shortfalls, why_unreachable
from stiffmap.ui.cli import main


def test_the_legs_of_an_orthoglide_end_short_by_their_length() -> None:
    """Legs x and y hold the platform within 775 mm of their guides; leg z slides along."""
    found = shortfalls("orthoglide-revised", [0, 0, 0.9])
    assert {s.leg for s in found} == {"x", "y"}
    assert [s.translation for s in found] == pytest.approx([0.9 - 0.775] * 2, abs=1e-6)


def test_a_five_bar_by_its_arms() -> None:
    m = sm.load_machine("five-bar")
    reach = {s.leg: s.translation for s in shortfalls(m, [0.9, 0.4, 0.0])}
    for name, x in (("left", -0.15), ("right", 0.15)):
        assert reach[name] == pytest.approx(np.hypot(0.9 - x, 0.4) - 0.300 - 0.374, abs=1e-7)


def test_an_orientation_that_a_leg_does_not_give() -> None:
    turned = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    found = shortfalls("orthoglide-revised", [0, 0, 0], turned)
    assert {s.leg for s in found} == {"y", "z"}
    assert [s.rotation for s in found] == pytest.approx([np.pi / 6] * 2, abs=2e-4)
    text = why_unreachable("orthoglide-revised", [0, 0, 0], turned)
    assert text == "legs y, z end 30 deg off the orientation; leg x would reach it"


@pytest.mark.parametrize(
    ("name", "at", "text"),
    [
        (
            "orthoglide-original",
            (8, 0, 0),
            "legs y, z end 7690 mm short of it; leg x would reach it",
        ),  # bars of 310 mm
        (
            "orthoglide-revised",
            (0, -8, 0),
            "legs x, z end 7225 mm short of it; leg y would reach it",
        ),  # of 775 mm
        ("orthoglide-original", (0, 0, 8), "legs x, y end 7690 mm short of it; leg z would reach it"),
        ("tripteron", (0, 0, 8), "leg 1 would reach it"),
        ("rotary-delta", (0, -8, 0), "leg a ends 7206 mm short of it"),
        ("hybrid", (8, 0, 0), "leg a ends 7525 mm short of it"),
        ("hybrid", (0, -80, 0), "mm short of it"),
        ("ur10", (0, -8, 0), "leg arm ends 6909 mm short of it"),
    ],
)
def test_far_outside_it_is_the_distance_that_is_said(name: str, at: tuple[float, ...], text: str) -> None:
    m = sm.load_machine(name)
    found = why_unreachable(m, m.description.home.p + np.array(at))
    assert text in found and "orientation" not in found


@pytest.mark.parametrize("name", sm.machine_names())
def test_a_pose_that_can_be_reached_lies_behind_nothing(name: str) -> None:
    m = sm.load_machine(name)
    for p in (m.description.home.p, 0.5 * (m.description.home.p + m.workspace.mean(axis=0))):
        if int(sm.inverse_kinematics(m, p).status) == sm.Status.CONVERGED:
            assert why_unreachable(m, p) == "nothing is in the way: the pose can be reached"


def test_a_reachable_pose_has_no_shortfall() -> None:
    for name in ("orthoglide-revised", "five-bar", "ur10", "tripteron"):
        m = sm.load_machine(name)
        assert shortfalls(m, m.workspace.mean(axis=0)) == [], name


def test_a_drive_out_of_its_range() -> None:
    text = why_unreachable("travelling-column", [0, 0.9, 0.0])
    assert text == "machine.head_drive would stand at -500 mm, its range is 100 to 1100 mm"


def test_what_is_no_pose() -> None:
    with pytest.raises(StiffmapError, match="3 finite numbers"):
        shortfalls("five-bar", [np.nan, 0, 0])
    assert why_unreachable("five-bar", [np.nan, 0, 0]) == "the commanded pose holds what is not a number"


def test_the_command_says_the_reason_and_no_table_of_nan(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "orthoglide-revised", "--at", "0,0,900", "--force", "300,0,0"]) == 1
    out = capsys.readouterr().out
    assert "reason: legs x, y end 125 mm short of it; leg z would reach it" in out
    assert "nan" not in out
    assert main(["solve", "orthoglide-revised", "--at", "0,0,900", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["reason"].startswith("legs x, y end 125 mm short")
    assert main(["solve", "orthoglide-revised", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["reason"] is None


@pytest.mark.parametrize("position", [(np.nan, 0.0, 0.0), (0.0, 0.0, np.nan), [[0.0, 0, 0], [0, np.inf, 0]]])
def test_what_is_no_number_is_said_in_python(position: object) -> None:
    m = sm.load_machine("orthoglide-revised")
    with pytest.warns(UserWarning, match=r"1 of \d positions are not finite numbers .nan or inf."):
        s = m.solve(position, np.zeros(6))
    assert np.atleast_1d(s.status)[-1] == sm.Status.UNREACHABLE
    with pytest.warns(UserWarning, match="not finite"):
        sm.inverse_kinematics(m, position)


def test_a_reachable_pose_says_nothing(recwarn: pytest.WarningsRecorder) -> None:
    sm.load_machine("orthoglide-revised").solve((0.1, -0.2, 0.1), np.zeros(6))
    assert not recwarn.list


SIX = """
name: six
units: {length: mm, force: N, angle: deg}
home: {solve: true, translation: [700, 50, 600], axes: xyz}
legs:
  arm:
    elements:
      - {actuator: j1, kind: revolute, axis: z, home: 0, stiffness: 1.0e+8}
      - {offset: o1, translation: [100, 0, 300]}
      - {actuator: j2, kind: revolute, axis: y, home: 10, stiffness: 1.0e+8}
      - {offset: o2, translation: [0, 0, 400]}
      - {actuator: j3, kind: revolute, axis: y, home: 80, stiffness: 1.0e+8}
      - {offset: o3, translation: [0, 20, 300]}
      - {actuator: j4, kind: revolute, axis: x, home: 20, stiffness: 1.0e+8}
      - {offset: o4, translation: [50, 0, 100]}
      - {actuator: j5, kind: revolute, axis: y, home: 30, stiffness: 1.0e+8}
      - {offset: o5, translation: [80, 0, 60]}
      - {actuator: j6, kind: revolute, axis: x, home: 0, stiffness: 1.0e+8}
      - {offset: o6, translation: [60, 0, 0]}
"""
"""No two axes but the second and third are parallel, no three meet: no closed form."""


@pytest.mark.parametrize("name", ["ur10", "six"])
def test_an_arm_reaches_all_round_its_first_axis(name: str, tmp_path: Path) -> None:
    """Poses that forward kinematics gives, also where the straight way from home leads through the base."""
    (tmp_path / "six.yaml").write_text(SIX, encoding="utf-8")
    machine = sm.load_machine(tmp_path / "six.yaml" if name == "six" else name)
    drives = [machine.compiled.names.joints[a] for a in machine.actuators]
    joints = np.tile(machine.compiled.home_coordinates()[drives], (48, 1))
    joints += np.random.default_rng(1).uniform(-0.1, 0.1, joints.shape)
    joints[:, 0] += np.linspace(-3.0, 3.0, len(joints))
    at = sm.forward_kinematics(machine, joints)
    for method in ("fast", "reference"):
        here = machine.solve(at.position, np.zeros(6), rotation=at.rotation, method=method)
        assert (here.status == sm.Status.CONVERGED).all()
        found = here.coordinates[:, drives]
        if (
            name == "ur10"
        ):  # in the configuration of home; without parallel axes the way may lead to another one
            np.testing.assert_allclose(found, joints, rtol=0, atol=1e-7)
        there = sm.forward_kinematics(machine, found)
        np.testing.assert_allclose(there.position, at.position, rtol=0, atol=1e-9)
        np.testing.assert_allclose(there.rotation, at.rotation, rtol=0, atol=1e-9)


def test_what_an_arm_reaches_at_no_angle_of_its_first_axis_stays_unreachable() -> None:
    machine = sm.load_machine("ur10")
    angle = np.linspace(-3.0, 3.0, 12)
    far = np.column_stack([1.6 * np.cos(angle), 1.6 * np.sin(angle), np.full(12, 0.3)])
    near = np.column_stack([0.05 * np.cos(angle), 0.05 * np.sin(angle), np.full(12, 0.3)])
    for position in (far, near):
        assert (machine.solve(position, np.zeros(6)).status == sm.Status.UNREACHABLE).all()

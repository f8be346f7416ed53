"""Why a pose cannot be reached: against the lengths of the machines."""

from __future__ import annotations

import json

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

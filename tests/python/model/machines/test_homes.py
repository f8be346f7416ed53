"""Homes and commands of few digits: closed within the input's precision, then exact; one meaning of home."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.model.description import Joint
from stiffmap.model.files import description_from_text, description_text
from stiffmap.model.files.shipped import machine_folder
from stiffmap.solve.advice import check_file
from stiffmap.solve.status import Status
from stiffmap.ui.cli import main

UNITS = "units: {length: mm, force: N, angle: deg}\n"
CORNERS = {"a": (300, 200), "b": (-300, 200), "c": (-300, -200), "d": (300, -200)}
COMPLIANCE = np.diag([2e-8, 3e-8, 1e-9, 4e-7, 5e-7, 6e-7])  # m/N, rad/(N·m), of one guide


def machine(text: str) -> sm.Machine:
    return sm.Machine(description_from_text(text))


def table(miss: float = 0.0, turn: float = 0.0) -> str:
    """A lift on four upright guides, one of them driven; guide d stands off by `miss` mm, `turn` deg."""
    legs = []
    for name, (x, y) in CORNERS.items():
        sort = "actuator: lift, rigid: true" if name == "a" else "joint: guide"
        odd = name == "d"
        by = f", turns: [{{about: x, by: {turn}}}]" if odd else ""
        legs.append(
            f"  {name}:\n    frame: {{translation: [{x}, {y}, 0]}}\n    elements:\n"
            f"      - {{{sort}, kind: prismatic, axis: z, home: 400}}\n"
            f"      - {{spring: post, compliance: [2.0e-5, 3.0e-5, 1.0e-6, 4.0e-10, 5.0e-10, 6.0e-10]}}\n"
            f"      - {{offset: back, translation: [{-x + miss * odd}, {-y}, {0.3 * miss * odd}]{by}}}\n"
        )
    return "name: lift\n" + UNITS + "home: {translation: [0, 0, 400]}\nlegs:\n" + "".join(legs)


def lift_stiffness() -> np.ndarray:
    """(6, 6) closed form: posts side by side, each but the driven one free along z."""
    total = np.zeros((6, 6))
    for name, (x, y) in CORNERS.items():
        k = np.linalg.inv(COMPLIANCE)
        if name != "a":
            k[2, :] = k[:, 2] = 0.0
        px, py = -x * 1e-3, -y * 1e-3  # the tcp seen from the post
        carry = np.eye(6)  # twist of the tcp to that of the post's end: v + w x (-p)
        carry[:3, 3:] = np.array([[0, 0, py], [0, 0, -px], [-py, px, 0]])
        total += carry.T @ k @ carry
    return total


@pytest.mark.parametrize("method", ["fast", "reference"])
@pytest.mark.parametrize(("miss", "turn"), [(0.0, 0.0), (3e-4, 0.0), (0.0, 2e-5), (-2e-4, 1e-5)])
def test_an_over_constrained_home_of_few_digits_closes(miss: float, turn: float, method: str) -> None:
    lift = machine(table(miss, turn))
    for z in (0.4, 0.55):
        s = lift.solve([0, 0, z], method=method)
        assert s.status == Status.CONVERGED
        assert np.abs(s.displacement).max() < 1e-12
        assert np.abs(s.stiffness - lift_stiffness()).max() < 1e-6 * np.abs(lift_stiffness()).max()


def test_a_home_off_by_more_than_its_digits_is_refused() -> None:
    with pytest.raises(
        sm.StiffmapError, match=r"lift: home configuration does not close: d by 0\.0(2|1)\d* mm"
    ):
        machine(table(0.02))
    with pytest.raises(sm.StiffmapError, match=r"d by 0\.01 deg"):
        machine(table(0.0, 0.01))


@pytest.mark.parametrize("angle", [1e-11, 1e-8, 3e-7])
def test_a_commanded_rotation_off_by_its_digits_is_reached(angle: float) -> None:
    m = sm.load_machine("orthoglide-original")
    p = np.array([0.05, -0.02, 0.03])
    turned = np.array([[1, -angle, 0], [angle, 1, 0], [0, 0, 1]])
    exact = m.solve(p, [100, 0, 0, 0, 0, 0])
    for method in ("fast", "reference"):
        s = m.solve(p, [100, 0, 0, 0, 0, 0], rotation=turned, method=method)
        assert s.status == Status.CONVERGED
        assert s.displacement == pytest.approx(exact.displacement, rel=1e-5, abs=1e-12)
        assert m.solve(p, rotation=turned, method=method).displacement == pytest.approx(
            np.zeros(6), abs=1e-12
        )


def test_a_commanded_rotation_that_the_machine_cannot_make_is_unreachable() -> None:
    m = sm.load_machine("orthoglide-original")
    c, s = np.cos(1e-4), np.sin(1e-4)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for method in ("fast", "reference"):
        assert m.solve([0, 0, 0], rotation=turned, method=method).status == Status.UNREACHABLE


def test_a_pose_beyond_the_border_is_unreachable() -> None:
    """The tolerance is for equations that contradict each other, not for the workspace's border."""
    arm = (
        "name: arm\n"
        + UNITS
        + "task: [x, y]\nhome: {translation: [500, 300, 0]}\nlegs:\n  arm:\n    elements:\n"
    )
    arm += "      - {actuator: a, kind: revolute, axis: z, home: 74.2, rigid: true}\n"
    arm += "      - {offset: one, translation: [400, 0, 0]}\n"
    arm += "      - {actuator: b, kind: revolute, axis: z, home: -86.4, rigid: true}\n"
    arm += "      - {offset: two, translation: [400, 0, 0]}\n"
    arm += "      - {spring: s, compliance: [1e-6, 1e-6, 1e-6, 1e-9, 1e-9, 1e-9]}\n"
    m = machine(arm)
    reach = 0.8 * np.array([np.cos(0.4), np.sin(0.4), 0])
    assert m.solve(reach * 0.999).status == Status.CONVERGED
    for beyond in (1e-7, 1e-6, 1e-4):
        assert m.solve(reach * (1 + beyond)).status == Status.UNREACHABLE


FIVE_BAR = machine_folder() / "five-bar.yaml"


def rough_five_bar() -> str:
    """Home angles of three digits, and no turn at the platform to make its orientation zero."""
    text = Path(FIVE_BAR).read_text()
    text = text.replace("attach: {turns: [{about: z, by: -28.072486935852957}]}", "note: rough")
    text = text.replace("home: -151.92751306414704", "home: -123.9")  # the right leg ends as the left one
    for angle in set(re.findall(r"home: (-?\d+\.\d{8,})", text)):
        text = text.replace(angle, f"{float(angle):.1f}")
    return text


def test_home_closes_within_the_task() -> None:
    m, exact = machine(rough_five_bar()), sm.load_machine("five-bar")
    for p in ([0, 0.416, 0], [0.08, 0.45, 0], [-0.1, 0.37, 0]):
        angles = sm.inverse_kinematics(m, p).actuators
        elbows = [
            np.array([x, 0]) + 0.3 * np.array([np.cos(q), np.sin(q)])
            for x, q in zip((-0.15, 0.15), angles, strict=True)
        ]
        assert [np.linalg.norm(np.array(p[:2]) - e) for e in elbows] == pytest.approx([0.374] * 2, abs=1e-12)
        assert angles == pytest.approx(sm.inverse_kinematics(exact, p).actuators, abs=1e-12)
        for method in ("fast", "reference"):
            s, t = (k.solve(p, [50, 20, 0, 0, 0, 0], method=method) for k in (m, exact))
            assert s.status == t.status == Status.CONVERGED
            assert s.displacement == pytest.approx(t.displacement, rel=1e-9, abs=1e-15)


def test_home_solved_from_a_guess() -> None:
    text = rough_five_bar().replace(
        "home: {translation: [0, 416, 0]}", "home: {translation: [0, 416, 0], solve: true}"
    )
    text = re.sub(r"home: -?\d+\.\d", "home: 20", text)
    with pytest.raises(sm.StiffmapError, match="does not close"):
        machine(text.replace(", solve: true", ""))
    description = description_from_text(text)
    m = sm.Machine(description)
    (a, b) = sm.inverse_kinematics(m, [0, 0.416, 0]).actuators
    for x, q in ((-0.15, a), (0.15, b)):
        elbow = np.array([x + 0.3 * np.cos(q), 0.3 * np.sin(q)])
        assert np.linalg.norm(elbow - [0, 0.416]) == pytest.approx(0.374, abs=1e-12)
    assert description_from_text(description_text(description)) == description


def test_the_message_is_in_the_units_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(
        Path(FIVE_BAR).read_text().replace("home: -151.92751306414704", "home: -121.92751306414704")
    )
    assert main(["check", str(file)]) == 2
    error = capsys.readouterr().err
    assert re.search(r"home configuration does not close: right by 30 deg", error)
    assert "legs." not in error and " m " not in error


def test_check_says_what_it_changed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "rough.yaml"
    file.write_text(rough_five_bar())
    assert main(["check", str(file)]) == 0
    out = capsys.readouterr().out
    assert re.search(r"left\.motor: 126\.9 deg becomes 126\.8\d+ deg", out)
    changes = {c.name: c for c in check_file(file).changes}
    assert changes["right.motor"].closed == pytest.approx(np.radians(53.13010235415598), abs=1e-12)


@pytest.mark.parametrize(
    "path", [machine_folder() / f"{name}.yaml" for name in sm.machine_names()], ids=sm.machine_names()
)
def test_a_shipped_machine_closes_as_declared(path: str) -> None:
    """Also where joints stand before or behind the legs."""
    assert not check_file(path).changes


def slide(home: float) -> str:
    """A drive with a compliance that grows along its stroke, and an elastic hinge; closes at home 100 mm, 30°."""
    text = "name: slide\n" + UNITS + "home: {translation: [600, 0, 0], turns: [{about: z, by: 30}]}\n"
    text += "legs:\n  only:\n    elements:\n"
    text += f"      - {{actuator: drive, kind: prismatic, axis: x, home: {home}, compliance: 1e-5, compliance_slope: 0.01}}\n"
    text += "      - {offset: arm, translation: [500, 0, 0]}\n"
    text += f"      - {{joint: hinge, kind: revolute, axis: z, home: {30 + home - 100}, stiffness: 2e5}}\n"
    return text


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_everything_counts_from_the_closed_home(method: str) -> None:
    exact, rough = machine(slide(100)), machine(slide(102))
    for x in (0.6, 0.63):
        turn = np.array([[np.cos(np.pi / 6), -0.5, 0], [0.5, np.cos(np.pi / 6), 0], [0, 0, 1]])
        a, b = (m.solve([x, 0, 0], [7, 0, 0, 0, 0, 3], rotation=turn, method=method) for m in (exact, rough))
        drive = 1e-8 * (1 + 10 * (x - 0.6)) * 7  # 0.01 per mm
        for s in (a, b):
            assert s.status == Status.CONVERGED
            assert s.displacement[0] == pytest.approx(drive, rel=1e-9)
            assert s.displacement[5] == pytest.approx(3 / 200.0, rel=1e-9)  # 2e5 N·mm/rad


def test_a_pose_at_the_end_of_a_drive_is_within_its_range() -> None:
    """Commanded to an end, it comes back from kinematics with other last digits; a micrometre further is outside."""
    machine = sm.load_machine("linear-delta")
    joints = [e for leg in machine.description.legs for e in leg.elements if isinstance(e, Joint) and e.drive]
    assert joints[0].drive and joints[0].drive.range
    low, high = joints[0].drive.range
    for end, inside in ((low, 0.06), (high, -0.06)):
        for turn in np.linspace(0.3, 0.7, 11):
            for past, outside in ((0.0, False), (-np.sign(inside) * 1e-6, True)):
                drives = [end + past, end + inside + 0.05 * turn, end + inside - 0.03 * turn]
                p = sm.forward_kinematics(machine, drives).position
                for method in ("fast", "reference"):
                    s = machine.solve(p, np.zeros(6), method=method)
                    assert bool(int(s.flags) & sm.Flag.DRIVE_RANGE) == outside

"""URDF files as makers publish them: many ends, jaws, coupled joints off the way, dust, limits that are not given."""

from __future__ import annotations

import re
import warnings
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pytest
from tests.python.model.urdf.oracle import Robot

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.model.description import Body, Drive, Joint
from stiffmap.model.urdf import Imported, import_urdf
from stiffmap.ui.cli import main

CASES = Path(__file__).parent / "cases"
DUST = (CASES / "cad-dust.urdf").read_text()
GRIPPER = (CASES / "gripper-mimic.urdf").read_text()
NO_LIMIT = (CASES / "joint-without-limit.urdf").read_text()


def joint(
    name: str, parent: str, child: str, kind: str = "fixed", more: str = "", at: str = "0.1 0.02 0.3"
) -> str:
    return (
        f'<link name="{child}"><inertial><origin xyz="0.01 0.02 0.05" rpy="0.1 0.2 0.3"/><mass value="0.7"/>'
        '<inertia ixx="0.002" iyy="0.003" izz="0.004" ixy="1e-4" ixz="2e-4" iyz="-3e-4"/></inertial></link>'
        f'<joint name="{name}" type="{kind}"><origin xyz="{at}" rpy="0.3 -0.2 0.1"/><axis xyz="0 1 0"/>'
        f'<parent link="{parent}"/><child link="{child}"/>{more}</joint>'
    )


def arm(prefix: str = "", base: str = "base") -> str:
    """Three moving joints."""
    ends = [base, *(f"{prefix}{k}" for k in "abc")]
    return "".join(joint(f"{prefix}q{i}", ends[i], ends[i + 1], "revolute") for i in range(3))


def robot(*parts: str) -> str:
    return '<robot name="r"><link name="base"/>' + "".join(parts) + "</robot>"


def imported(folder: Path, text: str, tip: str | None = None) -> Imported:
    file = folder / "arm.urdf"
    file.write_text(text)
    return import_urdf(file, tip=tip)


def bodies(found: Imported) -> dict[str, list[Body]]:
    """Bodies behind each joint of the arm."""
    out: dict[str, list[Body]] = {}
    for e in found.description.legs[0].elements:
        if isinstance(e, Joint):
            out[e.name] = []
        elif isinstance(e, Body):
            out[list(out)[-1]].append(e)
    return out


FINGERS = joint("f1", "hand", "finger_1", "prismatic") + joint("f2", "hand", "finger_2", "prismatic")
MIMIC = joint("f1", "hand", "finger_1", "prismatic") + joint(
    "f2", "hand", "finger_2", "prismatic", '<mimic joint="f1"/>'
)
HAND = joint("h", "c", "hand")
TIPS = {
    "base frames are no tools": (robot(joint("b", "base", "world"), arm(), joint("t", "c", "end")), "end"),
    "tool0 before the flange": (robot(arm(), joint("e", "c", "flange"), joint("t", "c", "tool0")), "tool0"),
    "tool0 among sensors": (robot(arm(), joint("e", "c", "ft_frame"), joint("t", "c", "r_tool0")), "r_tool0"),
    "frames on the way": (robot(joint("k", "a", "camera"), arm(), joint("t", "c", "end")), "end"),
    "tcp between fingers": (robot(arm(), HAND, FINGERS, joint("t", "hand", "r_hand_tcp")), "r_hand_tcp"),
    "two fingers": (robot(arm(), HAND, FINGERS), "hand"),
    "a finger that mimics": (robot(arm(), HAND, MIMIC), "hand"),
    "a jaw alone": (robot(arm(), HAND, joint("jointGripper", "hand", "mover", "revolute")), "hand"),
    "a jaw alone, before a frame": (robot(arm(), HAND, joint("jaw", "hand", "mover", "prismatic"), joint("m", "mover", "pad")),
                                    "hand"),
    "a jaw alone behind a tool": (robot(arm(), joint("t", "c", "tool0"), HAND.replace('"c"', '"tool0"'),
                                        joint("claw", "hand", "mover", "revolute")), "tool0"),
    "tool0 before a gripper": (robot(arm(), joint("t", "c", "tool0"), joint("h", "tool0", "hand"), FINGERS), "tool0"),
    "tool0 before a hand": (robot(arm(), joint("t", "c", "tool0"), joint("h", "tool0", "hand"), *(
        joint(f"{f}{k}", ("hand", f"{f}1")[k - 1], f"{f}{k}", "revolute") for f in "xyz" for k in (1, 2))), "tool0"),
    "wheels": (robot(arm(), joint("t", "c", "TCP"), *(joint(f"w{i}", "base", f"wheel_{i}", "continuous") for i in "12")),
               "TCP"),
    "rod of a coupling": (robot(arm(), joint("t", "c", "end"), joint("m", "a", "rod", "revolute", '<mimic joint="q1"/>')),
                          "end"),
    "end effector": (robot(arm(), joint("t", "c", "lEndEffector"), joint("s", "c", "skin")), "lEndEffector"),
}  # fmt: skip


@pytest.mark.parametrize("name", TIPS)
def test_tip(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, tip = TIPS[name]
    found = imported(tmp_path, text)
    assert found.tip == tip
    q = [0.3, -0.4, 0.5]
    k = sm.forward_kinematics(sm.Machine(found.description), q)
    wanted = Robot(text).place(tip, {f"q{i}": v for i, v in enumerate(q)})
    np.testing.assert_allclose(k.position, wanted[:3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(k.rotation, wanted[:3, :3], rtol=0, atol=1e-12)
    assert main(["import", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "arm.yaml")]) == 0
    assert (f"tip {tip}, chosen from the ends" in capsys.readouterr().out) == bool(found.choice)
    assert sm.load_machine(tmp_path / "arm.yaml") == sm.import_urdf(tmp_path / "arm.urdf")


@pytest.mark.parametrize("name", ["gripper_roll", "wrist_to_gripper", "joint_4"])
def test_a_last_joint_that_turns_a_gripper_is_a_drive(name: str, tmp_path: Path) -> None:
    found = imported(tmp_path, robot(arm(), joint(name, "c", "gripper", "revolute")))
    assert (found.tip, found.choice, len(found.rigid)) == ("gripper", "", 4)
    of_a_gripper = robot(joint("jaw_1", "base", "a", "revolute"), joint("jaw_2", "a", "b", "revolute"))
    assert imported(tmp_path, of_a_gripper).tip == "b"


MANY = {
    "a robot with two wheels": (robot(joint("l", "base", "left", "continuous"), joint("r", "base", "right", "continuous")),
                                "2 ends (left, right)"),
    "two arms": (robot(arm("l"), arm("r")), "2 ends (lc, rc)"),
    "two arms with tools": (robot(arm("l"), arm("r"), joint("x", "lc", "l_tool0"), joint("y", "rc", "r_tool0")),
                            "2 ends (l_tool0, r_tool0)"),
    "arms of other names": (robot(arm("l"), arm("r"), joint("x", "lc", "tool0"), joint("y", "rc", "flange")),
                            "2 ends (tool0, flange)"),
    "two hands": (robot(arm("l"), arm("r"), *(
        joint(f"{s}{f}", f"{s}c", f"{s}{f}", "prismatic") for s in "lr" for f in "xy")), "2 ends (lc, rc)"),
    "legs": (robot(*(arm(k) for k in "wxyz")), "4 ends (wc, xc, yc, zc)"),
}  # fmt: skip


@pytest.mark.parametrize("name", MANY)
def test_several_tools(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, ends = MANY[name]
    file, out = tmp_path / "arm.urdf", tmp_path / "arm.yaml"
    file.write_text(text)
    assert main(["import", str(file), "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert ends in error and "--tip LINK" in error and str(file) in error and error.count("\n") == 1
    tip = ends.split(", ")[-1].rstrip(")")
    assert main(["import", str(file), "-o", str(out), "--tip", tip]) == 0
    assert sm.load_machine(out) == sm.import_urdf(file, tip=tip)
    assert len(sm.load_machine(out).actuators) == (1 if "wheels" in name else 3)


BAD = {
    "xacro": ('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="a"/></robot>',
              "this is xacro, expand it with: xacro arm.urdf > arm_expanded.urdf"),
    "xacro without its namespace": ('<robot><xacro:arm prefix=""/></robot>', "this is xacro, expand it with"),
    "numbers of xacro": (robot(arm()).replace("0.1 0.02 0.3", "0 0 ${d}"), "this is xacro, expand it with"),
    "coupled": (robot(arm(), joint("m", "c", "tool", "revolute", '<mimic joint="q1"/>')),
                "joint m: mimics joint 'q1' and lies on the way to the tip"),
    "floating": (robot(joint("m", "base", "x", "floating"), arm(base="x")),
                 "joint m: type 'floating' cannot be imported on the way to the tip"),
    "nothing moves": (robot(joint("m", "base", "x")), "no joint moves"),
    "limits": (robot(arm(), joint("m", "c", "x", "revolute", '<limit lower="2" upper="1"/>')),
               "joint m: the lower limit 2 lies above the upper one, 1"),
    "no inertia of a body": (robot(arm()).replace('ixx="0.002"', 'ixx="-0.002"', 1),
                             "link a: the inertia has a negative principal moment (-0.00"),
    "no number": (robot(arm()).replace('ixx="0.002"', 'ixx="x"', 1), "link a: ixx: expected a number, found 'x'"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_refused_in_one_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, message = BAD[name]
    file = tmp_path / "arm.urdf"
    file.write_text(text)
    assert main(["import", str(file), "-o", str(tmp_path / "m.yaml")]) == 2
    error = capsys.readouterr().err
    assert message in error and str(file) in error and error.count("\n") == 1
    with pytest.raises(FileError) as caught:
        sm.import_urdf(file)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("tip", "message"), [("tol", "tip: no frame 'tol'"), ("base", "no joint moves link 'base'")]
)
def test_bad_tip(tip: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message):
        imported(tmp_path, robot(arm(), joint("t", "c", "tool")), tip)


def test_gripper_is_left_out_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "arm.urdf").write_text(GRIPPER)
    (tmp_path / "side.yaml").write_text("tip: tool\n")
    out = tmp_path / "arm.yaml"
    assert (
        main(["import", str(tmp_path / "arm.urdf"), "--sidecar", str(tmp_path / "side.yaml"), "-o", str(out)])
        == 0
    )
    said = capsys.readouterr().out
    assert "legs arm; 2 actuators" in said and "jaw_a, jaw_b" in said
    k = sm.forward_kinematics(sm.load_machine(out), [0.3, -0.5])
    wanted = Robot(GRIPPER).place("tool", {"shoulder": 0.3, "elbow": -0.5})
    np.testing.assert_allclose(k.position, wanted[:3, 3], rtol=0, atol=1e-12)


WEIGHTS = {
    "jaws": robot(arm(), HAND, FINGERS),
    "a jaw that mimics": robot(arm(), HAND, MIMIC, joint("t", "finger_2", "pad")),
    "a second arm": robot(arm(), joint("t", "c", "tool"), arm("left", "a")),
    "a load on a ball": robot(arm(), joint("t", "c", "tool"), joint("f", "b", "load", "floating")),
}


@pytest.mark.parametrize("name", WEIGHTS)
def test_masses_of_what_is_left_out_stay(name: str, tmp_path: Path) -> None:
    text = WEIGHTS[name]
    groups = list(bodies(imported(tmp_path, text)).values())
    judge = Robot(text)
    for head, after, found in zip("abc", ("b", "c", ""), groups, strict=True):
        mass, centre, inertia = judge.masses(head, {after})
        assert sum(b.mass for b in found) == pytest.approx(mass, rel=1e-12)
        c = sum(b.mass * np.array(b.com) for b in found) / mass
        np.testing.assert_allclose(c, centre, atol=1e-14)
        arms = [(b, np.array(b.com) - c) for b in found]
        total = sum(np.array(b.inertia) + b.mass * (r @ r * np.eye(3) - np.outer(r, r)) for b, r in arms)
        np.testing.assert_allclose(total, inertia, rtol=0, atol=1e-14)


def test_jaws_follow_a_home_and_each_other(tmp_path: Path) -> None:
    text = robot(
        arm(), HAND, MIMIC.replace('<mimic joint="f1"/>', '<mimic joint="f1" multiplier="-2" offset="0.01"/>')
    )
    (tmp_path / "side.yaml").write_text("home: {f1: 0.03}\n")
    (tmp_path / "arm.urdf").write_text(text)
    found = bodies(import_urdf(tmp_path / "arm.urdf", tmp_path / "side.yaml"))["q2"]
    _, centre, _ = Robot(text).masses("c", set(), {"f1": 0.03, "f2": -0.05})
    c = sum(b.mass * np.array(b.com) for b in found) / sum(b.mass for b in found)
    np.testing.assert_allclose(c, centre, atol=1e-14)


def test_links_without_a_mass_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = re.sub("<inertial>.*?</inertial>", "", robot(arm()))
    text = bare.replace('<link name="b">', '<link name="b"><inertial><mass value="0"/></inertial>')
    frame = joint("t", "c", "tool")  # its mass stays with c
    for parts, said in ((text, "a, b, c"), (text.replace("</robot>", frame + "</robot>"), "a, b")):
        (tmp_path / "arm.urdf").write_text(parts)
        out = tmp_path / "arm.yaml"
        assert main(["import", str(tmp_path / "arm.urdf"), "-o", str(out), "--overwrite"]) == 0
        assert f"no mass (gravity does not pull on these links): {said}\n" in capsys.readouterr().out
    assert not imported(tmp_path, robot(arm())).massless


def test_a_fixed_joint_follows_nothing(tmp_path: Path) -> None:
    """Exporters fix the fingers of a gripper, and leave their <mimic> in the file."""
    text = robot(
        arm(), joint("f", "c", "finger", "fixed", '<mimic joint="q2" multiplier="-1" offset="0.2"/>')
    )
    (tmp_path / "side.yaml").write_text("home: {q2: 0.7}\n")
    (tmp_path / "arm.urdf").write_text(text)
    found = bodies(import_urdf(tmp_path / "arm.urdf", tmp_path / "side.yaml"))["q2"]
    mass, centre, _ = Robot(text).masses("c", set())
    np.testing.assert_allclose(sum(b.mass * np.array(b.com) for b in found) / mass, centre, atol=1e-14)


def test_dust_of_a_tensor_is_zero(tmp_path: Path) -> None:
    upper = bodies(imported(tmp_path, DUST))["shoulder"][0]
    wanted = ((0.0123, 0.0, 0.0011), (0.0, 0.061, -0.0007), (0.0011, -0.0007, 0.067))
    assert upper.inertia == wanted
    for dust in ("1e-20", "-4.2e-90", "6.6e-17", "5e-14", "5e-324"):
        again = imported(tmp_path, DUST.replace("3.1e-114", dust))
        assert bodies(again)["shoulder"][0].inertia == wanted
    point = 'ixx="2.7e-20" iyy="5.4e-20" izz="-1.1e-18" ixy="0" ixz="1.3e-20" iyz="3.4e-21"'
    heavy = imported(
        tmp_path, DUST.replace('ixx="0.004" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"', point)
    )
    assert not np.any(bodies(heavy)["elbow"][0].inertia)
    real = bodies(imported(tmp_path, DUST.replace("3.1e-114", "1e-9")))["shoulder"][0].inertia
    assert real is not None and real[0][1] == real[1][0] == 1e-9
    turned = bodies(
        imported(tmp_path, DUST.replace('xyz="0.2 0 0.01" rpy="0 0 0"', 'xyz="1e-70 0 0" rpy="0.7 1.1 -2"'))
    )
    inertia = np.array(turned["shoulder"][0].inertia)
    assert (inertia == inertia.T).all()


LIMITS = {
    "": Drive(),
    '<limit lower="0" upper="0" effort="0" velocity="0"/>': Drive(),
    '<limit effort="0" velocity="3"/>': Drive(speed=3.0),
    '<limit lower="-inf" upper="1e308" effort="1e99" velocity="-1"/>': Drive(),
    '<limit upper="2" effort="5" velocity="0"/>': Drive(range=(0.0, 2.0), force=5.0),
}


@pytest.mark.parametrize("limit", LIMITS)
def test_limits_that_are_not_given(limit: str, tmp_path: Path) -> None:
    wanted = LIMITS[limit]
    for kind, text in (
        ("revolute", robot(arm(), joint("q3", "c", "tool", "revolute", limit))),
        ("continuous", robot(arm(), joint("q3", "c", "tool", "continuous", limit))),
    ):
        m = sm.Machine(imported(tmp_path, text).description)
        last = next(e for e in m.description.legs[0].elements if e.name == "q3")
        expected = wanted if kind == "revolute" else Drive(None, wanted.speed, wanted.force)
        assert isinstance(last, Joint) and (last.drive or Drive()) == expected
        m.save(tmp_path / "back.yaml")
        assert sm.load_machine(tmp_path / "back.yaml") == m


def test_a_continuous_joint_without_limit(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(NO_LIMIT)
    assert main(["import", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "arm.yaml")]) == 0
    first = next(
        e for e in sm.load_machine(tmp_path / "arm.yaml").description.legs[0].elements if e.name == "shoulder"
    )
    assert isinstance(first, Joint) and first.actuated and first.drive is None


def test_a_straight_wrist_is_a_singular_home(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "arm.yaml"
    assert main(["import", str(CASES / "arm-wrist-straight.urdf"), "-o", str(out)]) == 0
    assert main(["check", str(out)]) == 0
    said = capsys.readouterr().out
    assert "cannot move along (y, rz) = (-0.484, 0.875) (m, rad): the axes of j4 and j6 are in line" in said
    assert "give `home` with j5 bent" in said


def machine_of(length: float, mass: float, limits: str = "", kind: str = "revolute") -> str:
    """Three joints, a length apart, which carry a mass each; its radius is a tenth of the length."""
    inertia = mass * (length / 10) ** 2
    ends = ["base", "a", "b", "c"]
    parts = [
        joint(f"q{i}", ends[i], ends[i + 1], kind, limits, at=f"0 0 {length}")
        .replace('mass value="0.7"', f'mass value="{mass}"')
        .replace('xyz="0.01 0.02 0.05"', f'xyz="0 0 {length / 2}"')
        .replace('ixx="0.002" iyy="0.003" izz="0.004" ixy="1e-4" ixz="2e-4" iyz="-3e-4"',
                 f'ixx="{inertia}" iyy="{inertia}" izz="{inertia}"')
        for i in range(3)
    ]  # fmt: skip
    return robot(*parts)


def tensors(text: str, moment: float) -> str:
    """A machine with other moments of inertia."""
    return re.sub(r'(i[xyz]{2})="[^"]*"', rf'\1="{moment}"', text)


DOUBTS = {
    "millimetres": (machine_of(400.0, 5), "joint q2: origin: found 800 m; expected metres, 0.8 m if these are millimetres"),
    "inertial in millimetres": (machine_of(0.4, 5).replace('xyz="0 0 0.2"', 'xyz="0 0 200"'),
                                "link a: inertial: found 200 m; expected metres, 0.2 m if these are millimetres"),
    "inertial of a small arm in millimetres": (machine_of(0.03, 0.1).replace('xyz="0 0 0.015"', 'xyz="0 0 15"'),
                                               "link a: inertial: found 15 m; expected metres, 0.015 m if these are millimetres"),
    "stroke in millimetres": (machine_of(0.4, 5, '<limit lower="-50" upper="350"/>', "prismatic"),
                              "joint q0: limit: found 400 m; expected metres, 0.4 m if these are millimetres"),
    "degrees": (machine_of(0.4, 5, '<limit lower="-180" upper="92.5"/>'),
                "joint q0: limit: found -180 to 92.5 rad; expected radians, -3.142 to 1.614 if these are degrees"),
    **{f"small degrees, {rpy}": (machine_of(0.4, 5).replace('rpy="0.3 -0.2 0.1"', f'rpy="{rpy}"', 1),
                                 f"joint q0: rpy: found {first} rad; expected radians, {rad} rad if it and others are degrees")
       for rpy, first, rad in (("0 0 3", 3, 0.0524), ("1 0 0", 1, 0.0175), ("0 -2 0", -2, -0.0349), ("0.2 0 1.5", 1.5, 0.0262))},
    "grams": (machine_of(0.4, 2500), "link a: mass: found 2500 kg, and 7500 kg in all that moves, in a machine of 0.8 m; expected "
                                     "kilograms, 2.5 kg if these are grams"),
    "kg mm²": (tensors(machine_of(0.4, 5), 8e3), "link a: inertia: found a radius of gyration of 40 m in a machine of 0.8 m; "
                                                 "expected kg m^2, 0.04 m if these are kg mm^2"),
    "g mm²": (tensors(machine_of(0.4, 5), 8e6), "link a: inertia: found a radius of gyration of 1265 m in a machine of 0.8 m; "
                                                "expected kg m^2, 1.26 m if these are kg mm^2, 0.04 m if g mm^2"),
    "a shape of no body": (machine_of(0.4, 5).replace('izz="0.008', 'izz="0.018'),
                           "link a: inertia: found principal moments of 0.008, 0.008 and 0.018 kg m^2, which no body has; expected "
                           "the largest to be at most the sum of the others, 0.016"),
}  # fmt: skip


@pytest.mark.parametrize("name", DOUBTS)
def test_numbers_that_no_machine_has_are_warned_of(name: str, tmp_path: Path) -> None:
    text, said = DOUBTS[name]
    (tmp_path / "arm.urdf").write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sm.import_urdf(tmp_path / "arm.urdf")
    (line,) = [str(w.message) for w in caught]
    assert line.startswith(f"{tmp_path / 'arm.urdf'}: {said}")


@pytest.mark.parametrize(
    "text",
    [
        machine_of(30.0, 9e4), machine_of(1.3, 1600), machine_of(0.02, 0.1), tensors(machine_of(0.4, 1e-3), 1.0),
        machine_of(0.4, 5, '<limit lower="-12.56" upper="12.56"/>'), machine_of(0.4, 5).replace("0.3 -0.2 0.1", "0.5 3.14 -1.57"), machine_of(0.4, 5, '<limit lower="-1e16" upper="1e16"/>'),
        machine_of(0.01, 1500, '<limit lower="0" upper="0.6"/>', "prismatic"), machine_of(0.4, 5, '<limit lower="-1e6" upper="1e6"/>', "prismatic"),
        machine_of(0.4, 5).replace('izz="0.008', 'izz="0.01605'),
        robot(arm()).replace('<link name="base"/>', '<link name="map"/><link name="base"/><joint name="m" type="fixed"><parent '
                             'link="map"/><child link="base"/><origin xyz="691000 5334000 0"/></joint>'),
    ],
    ids=["crane", "heavy arm", "finger", "moments of one", "four turns", "quarter turns", "no limit", "machine tool", "no end of a rail", "flat plate, rounded", "place on a map"],
)  # fmt: skip
def test_real_machines_are_not_doubted(text: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        imported(tmp_path, text)


def test_robots_of_example_robot_data() -> None:
    """Published robots, against kinematics that share nothing with the import."""
    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        pytest.skip("example-robot-data is not installed (pip install example-robot-data)")
    found = 0
    for file in [f.locate() for f in files if f.suffix == ".urdf"]:
        try:
            machine, tip = sm.import_urdf(str(file)), import_urdf(str(file)).tip
        except FileError:
            continue
        judge = Robot(Path(str(file)).read_bytes())
        names = [j.get("name") for j in judge.way(tip) if j.get("type") != "fixed"]
        q = np.random.default_rng(found).uniform(-1, 1, len(names))
        wanted = judge.place(tip, dict(zip(names, q, strict=True)))
        k = sm.forward_kinematics(machine, q)
        np.testing.assert_allclose(k.position, wanted[:3, 3], rtol=0, atol=1e-12)
        found += 1
    assert found > 20

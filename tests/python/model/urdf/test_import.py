"""URDF files as machines, against Pinocchio and against a machine written by hand."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from tests.python.model.urdf import robots

import stiffmap as sm
from stiffmap.model.description import Pose
from stiffmap.model.urdf import import_urdf
from stiffmap.model.urdf.editing import with_origins
from stiffmap.model.urdf.reader import read_urdf
from stiffmap.ui.cli import main


def written(folder: Path, urdf: str, sidecar: str | None = None) -> tuple[Path, Path | None]:
    a, b = folder / "robot.urdf", folder / "robot.yaml"
    a.write_text(urdf)
    if sidecar is not None:
        b.write_text(sidecar)
    return a, None if sidecar is None else b


def machine(folder: Path, urdf: str, sidecar: str | None = None) -> sm.Machine:
    return sm.Machine(import_urdf(*written(folder, urdf, sidecar)).description)


def test_forward_kinematics_and_jacobian_of_pinocchio(tmp_path: Path) -> None:
    pin = pytest.importorskip("pinocchio", reason="pinocchio is not installed (pip install pin)")
    arm = machine(tmp_path, robots.ARM, robots.ARM_SIDECAR)
    model = pin.buildModelFromXML(robots.ARM)
    data, tool = model.createData(), model.getFrameId("tool")
    rng = np.random.default_rng(2)
    for q in rng.uniform([-1, -1, -0.5, 0.0], [1, 1, 1.5, 0.3], (6, 4)):
        # q1 is continuous: Pinocchio keeps its cosine and sine
        full = np.r_[np.cos(q[0]), np.sin(q[0]), q[1:]]
        pin.computeJointJacobians(model, data, full)
        pin.updateFramePlacements(model, data)
        at = data.oMf[tool]
        k = sm.forward_kinematics(arm, q)
        assert k.status == sm.Status.CONVERGED
        np.testing.assert_allclose(k.position, at.translation, rtol=0, atol=1e-12)
        np.testing.assert_allclose(k.rotation, at.rotation, rtol=0, atol=1e-12)
        # with springs only in the drives, compliance = J K^-1 J^T
        jacobian = pin.getFrameJacobian(model, data, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        drives_only = robots.ARM_SIDECAR.split("springs:")[0]
        s = machine(tmp_path, robots.ARM, drives_only).solve(at.translation, rotation=at.rotation)
        assert int(s.flags) & sm.Flag.RIGID_DIRECTION
        wanted = jacobian @ np.diag([1 / 4e4, 1 / 3e4, 5e-5, 1e-6]) @ jacobian.T
        np.testing.assert_allclose(s.compliance, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def test_masses_of_pinocchio(tmp_path: Path) -> None:
    """Torques of the drives against gravity."""
    pin = pytest.importorskip("pinocchio", reason="pinocchio is not installed (pip install pin)")
    stiff = (
        robots.ARM_SIDECAR.replace("e4}", "e9}")
        .replace("e6}", "e9}")
        .replace("5.0e-5", "1.0e-9")
        .split("springs:")[0]
    )
    arm = machine(tmp_path, robots.ARM, stiff)
    q = np.array([0.2, -0.4, 0.9, 0.1])
    model = pin.buildModelFromXML(robots.ARM)
    wanted = pin.rnea(
        model, model.createData(), np.r_[np.cos(q[0]), np.sin(q[0]), q[1:]], np.zeros(4), np.zeros(4)
    )
    home = arm.description.home
    s = arm.solve(home.p, rotation=home.r, gravity=[0, 0, -9.81])
    np.testing.assert_allclose(s.actuator_effort, wanted, rtol=1e-5, atol=1e-5)


def test_the_length_of_an_axis_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    long = machine(tmp_path, robots.ARM.replace('<axis xyz="1 0 0"/>', '<axis xyz="1e59 0 0"/>'))
    assert long == machine(tmp_path / "b", robots.ARM)


def test_closed_loop_is_the_five_bar_written_by_hand(tmp_path: Path) -> None:
    m = machine(tmp_path, robots.FIVE_BAR, robots.FIVE_BAR_SIDECAR)
    assert len(m.legs) == 2 and len(m.actuators) == 2
    p = np.array([[0.05, 0.40, 0], [-0.1, 0.45, 0], [0, 0.36, 0]])
    mine = sm.inverse_kinematics(m, p)
    shipped = sm.inverse_kinematics(sm.load_machine("five-bar"), p)
    assert (mine.status == sm.Status.CONVERGED).all()
    np.testing.assert_allclose(mine.actuators, shipped.actuators, rtol=0, atol=1e-10)
    assert m.solve(p, [50, 20, 0, 0, 0, 0]).ok.all()


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    urdf, side = written(tmp_path, robots.FIVE_BAR, robots.FIVE_BAR_SIDECAR)
    out = tmp_path / "out.yaml"
    assert main(["import", str(urdf), "--sidecar", str(side), "-o", str(out)]) == 0
    assert "2 actuators" in capsys.readouterr().out
    assert sm.load_machine(out) == sm.Machine(import_urdf(urdf, side).description)
    assert main(["import", str(urdf), "--sidecar", str(side), "-o", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["import", str(urdf), "-o", str(tmp_path / "other.yaml")]) == 2
    assert "the tree has 2 ends (tip_a, tip_b)" in capsys.readouterr().err


MESH = '<link name="base"><visual><geometry><mesh filename="meshes/base.stl"/></geometry></visual></link>'
MIMIC = '<parent link="base"/><child link="shoulder"/><mimic joint="q3"/>'
BAD_URDF = {
    "joint q1: mimics joint 'q3'": ('<parent link="base"/><child link="shoulder"/>', MIMIC),
    "joint q1: type 'floating' cannot be imported": ('type="continuous"', 'type="floating"'),
    "joint q1: no link 'sholder'": ('<child link="shoulder"/>', '<child link="sholder"/>'),
    "a zero-length axis": ('<axis xyz="1 0 0"/>', '<axis xyz="0 0 0"/>'),
    "xyz: expected three numbers, found '0 0'": ('<origin xyz="0 0 0.3"', '<origin xyz="0 0"'),
    "not XML": ("</robot>", ""),
    "link fore: there are 2 of this name": ('<link name="fore"/>', '<link name="fore"/><link name="fore"/>'),
    "joint q2: there are 2 of this name": ('name="q1"', 'name="q2"'),
    "links hang on each other in a ring and not on the root link 'base': shoulder, upper": (
        '<parent link="base"/>',
        '<parent link="fore"/>',
    ),
    "link shoulder: expected <mass value=...>, found '4' in it": ('<mass value="4"/>', "<mass>4</mass>"),
    "link upper: has no <mass value=...>": ('<mass value="3"/>', ""),
    "link slide: has no <inertia iyy=...>": ('iyy="0.01"', ""),
    "link slide: expected one <inertial>, found 2": ('<link name="slide">', '<link name="slide"><inertial/>'),
    "joint q1: expected one <origin>, found 2": ('<axis xyz="0 0 1"/>', '<origin rpy="0 0 1"/>'),
    "joint q1: origin: expected xyz and rpy, found quat_xyzw='0 0 0 1'": ('rpy="0 0 0.2"', 'quat_xyzw="0 0 0 1"'),
    "joint q4: rpy: expected radians, found '0 90 0', as degrees are": ('rpy="0 0.4 0"', 'rpy="0 90 0"'),
    "joint q4: a zero-length axis": ('<axis xyz="1 0 0"/>', '<axis rpy="1 0 0"/>'),
    "joint q1: expected <origin>, found <Origin>": ('<origin xyz="0 0 0.3"', '<Origin xyz="0 0 0.3"'),
    "joint q4: expected <origin>, found <orgin>": ('<origin xyz="0.1 0 0"', '<orgin xyz="0.1 0 0"'),
    "link fore: expected <inertial>, found <Inertial>": ('<link name="fore"/>', '<link name="fore"><Inertial/></link>'),
    "link upper: expected <mass>, found <Mass>": ('<mass value="3"/>', '<Mass value="3"/>'),
    "robot.urdf: expected <link>, found <Link>": ('<link name="fore"/>', '<Link name="fore"/>'),
    "expected one <robot>, found another in it: 'b'": ("</robot>", '<robot name="b"/></robot>'),
    "joint q2: limit: expected lower, found min='-2'": ('lower="-2" upper="2" effort="100"', 'min="-2" max="2" effort="100"'),
    "joint q3: limit: expected upper, found Uper='2'": ('upper="2" effort="80"', 'Uper="2" effort="80"'),
    "joint q3: expected <origin xyz=...>, found '0.4 0 0' in it": (
        '<origin xyz="0.4 0 0" rpy="0 0 0"/>',
        "<origin>0.4 0 0</origin>",
    ),
    "joint q3: expected <limit lower=...>, found '<lower><upper>' in it": (
        '<limit lower="-2" upper="2" effort="80" velocity="2"/>',
        "<limit><lower>-2</lower><upper>2</upper></limit>",
    ),
    "link shoulder: inertia: expected ixy, found iyx='0.001'": ('ixy="0.001"', 'iyx="0.001"'),
    "joint q4: rpy: expected radians, found '0 12 0', as degrees are": ('rpy="0 0.4 0"', 'rpy="0 12 0"'),
    "joint q4: rpy: expected radians, found '0 3.5 0', as degrees are": ('rpy="0 0.4 0"', 'rpy="0 3.5 0"'),
    "joint q3: expected <origin>, found <pose>": ('<origin xyz="0.4 0 0" rpy="0 0 0"/>', "<pose>0.4 0 0 0 0 0</pose>"),
    "joint q3: expected <origin>, found <transform>": (
        '<origin xyz="0.4 0 0" rpy="0 0 0"/>',
        '<transform><origin xyz="0.4 0 0"/></transform>',
    ),
    "link fore: expected <mass> in <inertial>, found it in <link>": (
        '<link name="fore"/>',
        '<link name="fore"><mass value="2"/></link>',
    ),
    "link fore: expected <link> in <robot>, found it in <link>": (
        '<link name="fore"/>',
        '<link name="fore"><link name="hand"/></link>',
    ),
    "joint q3: no link 'Fore' (did you mean 'fore'?)": ('<child link="fore"/>', '<child link="Fore"/>'),
    "expected one root link, found 2": ('<link name="fore"/>', '<link name="fore"/><link name="loose"/>'),
}  # fmt: skip


@pytest.mark.parametrize("message", BAD_URDF)
def test_bad_urdf(message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = BAD_URDF[message]
    assert old in robots.ARM
    urdf, _ = written(tmp_path, robots.ARM.replace(old, new))
    assert main(["import", str(urdf), "-o", str(tmp_path / "m.yaml")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "m.yaml").exists()


def test_two_names_that_are_one_in_a_machine_file(tmp_path: Path) -> None:
    with pytest.raises(
        sm.StiffmapError, match="joint: '关节一' and '关节二' would both be '_' in a machine file"
    ):
        machine(tmp_path, robots.ARM.replace('"q2"', '"关节一"').replace('"q3"', '"关节二"'))
    with pytest.raises(sm.StiffmapError, match=r"link: 'arm\.1' and 'arm/1' would both be 'arm_1'"):
        machine(tmp_path, robots.ARM.replace('"shoulder"', '"arm.1"').replace('"upper"', '"arm/1"'))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("elbow_a", "motor_a_origin"), ("motor_b", "elbow_b_origin"), ("fore_a", "platform"), ("fore_b", "base_"),
        ("arm_b", "attach"), ("elbow_b", "attach"), ("motor_b", "tip_b_ball"), ("arm_b", "tip_b_ball"),
        ("arm_a", "motor_a"), ("fore_b", "motor_b"), ("fore_b", "platform"), ("tip_b", "x y/z.1"),
    ],
)  # fmt: skip
def test_any_link_or_joint_may_have_a_name_that_the_import_makes_up(
    old: str, new: str, tmp_path: Path
) -> None:
    urdf, side = (re.sub(rf"\b{old}\b", new, t) for t in (robots.FIVE_BAR, robots.FIVE_BAR_SIDECAR))
    m = machine(tmp_path, urdf, side)
    m.save(tmp_path / "m.yaml")
    assert sm.load_machine(tmp_path / "m.yaml") == m
    as_it_was = machine(tmp_path, robots.FIVE_BAR, robots.FIVE_BAR_SIDECAR)
    assert (m.solve([0.05, 0.4, 0]).compliance == as_it_was.solve([0.05, 0.4, 0]).compliance).all()


NO_URDF = {
    "found <mujoco>, which is MuJoCo's format: give a URDF, or convert this first": "<mujoco><worldbody/></mujoco>",
    "found <sdf>, which is SDF: give a URDF": '<sdf version="1.7"><model name="a"/></sdf>',
    "found <COLLADA>, which is COLLADA: give": '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"/>',
    "the robot has no <link>, as in an SRDF": '<robot name="arm"><group name="hand"/></robot>',
    "this is a web page": "<!DOCTYPE html>\n<HTML><head><br></head></HTML>",
    "fetch that with: git lfs pull": "version https://git-lfs.github.com/spec/v1\noid sha256:0\n",
    "not XML: no element found: line 1": "",
    "expected a URDF (xacro puts a calibration into it)": "kinematics:\n  shoulder: {x: 0, y: 0, z: 0.1}\n",
}


@pytest.mark.parametrize("message", NO_URDF)
def test_what_is_no_urdf_says_what_it_is(
    message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf, _ = written(tmp_path, NO_URDF[message])
    assert main(["import", str(urdf), "-o", str(tmp_path / "m.yaml")]) == 2
    error = capsys.readouterr().err
    assert message in error and str(urdf) in error and error.count("\n") == 1


HEAD = '<?xml version="1.0"?>'
TOLERATED = {
    "dashes in comments": robots.ARM.replace('<link name="fore"/>', '<!-- -- <axis/> ---- --><link name="fore"/>').encode(),
    "lines before the declaration": ("\n \n" + HEAD + robots.ARM).encode(),
    "an & in the name of a mesh": robots.ARM.replace(
        '<link name="fore"/>', '<link name="fore"><visual><geometry><mesh filename="a&b.stl"/></geometry></visual></link>').encode(),
    "letters of another encoding in comments": ("<!-- für -->" + robots.ARM).encode("latin-1"),
    "an origin of a link": robots.ARM.replace('<link name="fore"/>', '<link name="fore"><origin xyz="1 2 3"/></link>').encode(),
    "a prefix of an attribute": robots.ARM.replace("<limit ", '<limit drake:acceleration="2" ').encode(),
    "an & in UTF-16": robots.ARM.replace('name="arm"', 'name="&#97;rm"').encode("utf-16"),
    "a mark, and lines of another system": ("\ufeff" + HEAD + robots.ARM).replace("\n", "\r\n").encode(),
}  # fmt: skip


@pytest.mark.parametrize("name", TOLERATED)
def test_what_readers_of_urdf_pass_over(name: str, tmp_path: Path) -> None:
    urdf = tmp_path / "robot.urdf"
    urdf.write_bytes(TOLERATED[name])
    (tmp_path / "b").mkdir()
    assert import_urdf(urdf).description == import_urdf(*written(tmp_path / "b", robots.ARM)).description


def test_origins_are_edited_in_a_file_that_xml_does_not_allow(tmp_path: Path) -> None:
    text = "\n" + HEAD + robots.ARM.replace("<joint", "<!-- -- <joint> & --><joint")
    (tmp_path / "robot.urdf").write_text(text)
    joint = read_urdf(tmp_path / "robot.urdf").joints["q3"]
    edited = with_origins(tmp_path / "robot.urdf", {"q3": (joint.origin, Pose((0.5, 0.0, 0.0)))})
    assert edited.decode() == text.replace('xyz="0.4 0 0"', 'xyz="0.5 0 0"')


def test_a_namespace_and_an_empty_name_say_nothing(tmp_path: Path) -> None:
    """As Drake's files have the one, and some exporters the other."""
    plain = machine(tmp_path, robots.ARM.replace('name="arm"', 'name="robot"'))
    other = robots.ARM.replace('name="arm"', 'xmlns="http://drake.mit.edu" name=""')
    assert machine(tmp_path, other).description.legs == plain.description.legs


def test_meshes_need_not_be_there(tmp_path: Path) -> None:
    urdf, _ = written(tmp_path, robots.ARM.replace('<link name="base"/>', MESH))
    assert import_urdf(urdf).rigid == ("q1", "q2", "q3", "q4")
    assert main(["import", str(urdf), "-o", str(tmp_path / "arm.yaml")]) == 0
    assert main(["import", str(urdf), "--unit", "a=mm", "-o", str(tmp_path / "arm.yaml")]) == 2


BAD_SIDECAR = {
    "closed_loop: no frame 'tip_c'": ("[[tip_a, tip_b]]", "[[tip_a, tip_c]]"),
    "name_mot: no joint 'motor_c'": ("[motor_a, motor_b]", "[motor_a, motor_c]"),
    "springs: no link 'arm_c'": ("arm_b: *arm", "arm_c: *arm"),
    "type: expected one entry per entry of closed_loop (1), found 0": ("[3d]", "[]"),
    "name_mot: a machine with closed loops has passive joints": ("[motor_a, motor_b]", "[]"),
    "closed_loop: the loops do not close upon one body": ("closed_loop:", "tip: arm_b\nclosed_loop:"),
    "give exactly one of stiffness and compliance": ("motor_a: {stiffness: 5.0e4}", "motor_a: {}"),
    "actuators.motor_a.stiffness: expected a number; found text ('5e4 N')": ("motor_a: {stiffness: 5.0e4", "motor_a: {stiffness: 5e4 N"),
    "motor_a.stiffness: expected a number greater than 0; found a number (-5.0)": ("motor_a: {stiffness: 5.0e4", "motor_a: {stiffness: -5.0"),
    "unknown key 'actuator' (did you mean 'actuators'?)": ("actuators:", "actuator:"),
    "robot.yaml, line 11: springs.arm_a.stiffness: expected 6 entries; found 5": ("&arm {stiffness: [7.0e8, ", "{stiffness: ["),
    "springs.arm_a.stiffness[5][0]: expected a number; found text ('1,5')":
        ("&arm {stiffness: [7.0e8, 1.0e7, 1.0e7, 1.0e5, 1.0e5, 1.0e5]}", f"{{stiffness: {[[1.0] * 6] * 5 + [['1,5', 0, 0, 0, 0, 1]]}}}"),
    "home configuration does not close": ("motor_b: 0.92730", "motor_b: 2.5"),
}  # fmt: skip


@pytest.mark.parametrize("message", BAD_SIDECAR)
def test_bad_sidecar(message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = BAD_SIDECAR[message]
    assert old in robots.FIVE_BAR_SIDECAR
    text = robots.FIVE_BAR_SIDECAR.replace(old, new)
    text = text if "&arm" in text else text.replace("  arm_b: *arm\n", "")
    urdf, side = written(tmp_path, robots.FIVE_BAR, text)
    assert main(["import", str(urdf), "--sidecar", str(side), "-o", str(tmp_path / "m.yaml")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1

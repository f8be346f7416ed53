"""The user's own URDF with corrected origins, against kinematics that share nothing with the package."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.model.urdf.oracle import Robot

import stiffmap as sm
from stiffmap.common.errors import FileError
from stiffmap.machining.compensation.geometry import corrected_urdf
from stiffmap.model.description import Joint, Offset, Pose
from stiffmap.model.urdf import import_urdf
from stiffmap.ui.cli.app import main

ARM = """<?xml version='1.0' encoding="utf-8"?>
<!-- Größe: a joint in a comment: <joint name="q1"><origin xyz="9 9 9"/></joint> -->
<robot name="arm" >
  <material name="grey"><color rgba=".5 .5 .5 1"/></material>
  <link name='base'><visual><origin xyz="1 2 3" rpy='0 0 1'/><geometry><mesh filename="package://a/b.dae"/></geometry></visual></link>
  <joint name='fix' type="fixed">
    <parent link="base"/> <child link="foot"/>
    <origin rpy="0 0 0.3"
            xyz="0.10 0  0.2" />  <!-- kept -->
  </joint>
  <link name="foot"/>
  <joint name="q1" type="revolute">
    <parent link="foot"/><child link="a"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="1"/>
  </joint>\r
  <link name="a"><inertial><origin xyz="0 0 .1"/><mass value="1.50"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="q 2" type="continuous"><origin xyz="0 0 0.40" rpy="0 1.5707963267948966 0"></origin>
    <parent link="a"/><child link="b"/><axis xyz="0 1 0"/><dynamics damping="0.5"/></joint>
  <link name="b"/>
  <joint name="q3" type="prismatic"><axis xyz="1 1 0"/><parent link="b"/><child link="c"/><origin rpy="0.1 -1.57 3.14"/>
    <limit lower="0" upper="1" effort="9" velocity="1"/></joint>
  <link name="c"/>
  <joint name="q4" type="revolute"><axis xyz="1 0 0"/><parent link="c"/><child link="d"/><origin xyz="1e-1 0.02 0"/></joint>
  <link name="d"/>
  <link name="tool0"/>
  <joint name="flange" type="fixed"><parent link="d"/><child link="tool0"/><origin xyz="0 0 .05" rpy="-0 0 0"/></joint>
  <link name="camera"/><joint name="eye" type="fixed"><origin xyz="0 .1 0"/><parent link="b"/><child link="camera"/></joint>
  <transmission name="t1"><joint name="q1"><origin xyz="7 7 7"/></joint></transmission>
  <gazebo reference="q1"><sensor:x/></gazebo>
</robot>
"""


CASES = Path(__file__).parents[2] / "model" / "urdf" / "cases"
BENT = [0.2, 0.3, -0.2, 0.1, 0.7, 0.1]


def bent(machine: sm.Machine, seed: int) -> sm.Machine:
    """Every link and every zero off, as built."""
    rng = np.random.default_rng(seed)

    def wrong(e: Any) -> Any:
        if isinstance(e, Offset):
            turn = Rotation.from_rotvec(rng.normal(0, 2e-3, 3)).as_matrix()
            return replace(e, actual=Pose.of(e.nominal.p + rng.normal(0, 3e-4, 3), e.nominal.r @ turn))
        return e

    d = machine.description
    out = sm.Machine(replace(d, legs=(replace(d.legs[0], elements=tuple(map(wrong, d.legs[0].elements))),)))
    for name in machine.actuators:
        out = out.with_effect("zero_offset", element=name.split(".")[-1], error=float(rng.normal(0, 2e-3)))
    return out


def real_tool(machine: sm.Machine, q: dict[str, float]) -> Any:
    """4x4 of the tool of the arm as it was built, from its description."""
    out = np.eye(4)
    d = machine.description
    for e in (*d.base, *d.legs[0].elements, *d.platform):
        step = np.eye(4)
        if isinstance(e, Offset):
            pose = e.actual or e.nominal
            step[:3, :3], step[:3, 3] = pose.r, pose.p
        elif isinstance(e, Joint):
            amount = q[e.name] + sum(c.offset for c in e.command_errors)
            along = amount * np.array(e.axes[0])
            if e.kind == "prismatic":
                step[:3, 3] = along
            else:
                step[:3, :3] = Rotation.from_rotvec(along).as_matrix()
        out = out @ step
    return out


def agree(machine: sm.Machine, tip: str, text: bytes, folder: Path) -> float:
    """Largest difference (m, and of the rotation) of the written file from the machine, by two readers, over postures."""
    (folder / "back.urdf").write_bytes(text)
    back, judge = sm.import_urdf(folder / "back.urdf", tip=tip), Robot(text.replace(b"<sensor:x/>", b""))
    rng, worst = np.random.default_rng(1), 0.0
    for _ in range(20):
        values = rng.uniform(-2, 2, len(machine.actuators))
        named = {a.split(".")[-1]: float(v) for a, v in zip(machine.actuators, values, strict=True)}
        wanted = real_tool(machine, named)
        raw = {
            str(j.get("name")): named.get(re.sub(r"\W+", "_", str(j.get("name"))), 0.0)
            for j in judge.way(tip)
        }
        k = sm.forward_kinematics(back, values)
        worst = max(worst, float(np.abs(judge.place(tip, raw) - wanted).max()),
                    float(np.abs(k.position - wanted[:3, 3]).max()))  # fmt: skip
    return worst


def test_the_own_file_has_the_corrected_arm(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_bytes(ARM.encode())
    found = import_urdf(file)
    machine = bent(sm.Machine(found.description), 3)
    text, left = corrected_urdf(machine.description, file)
    assert left == []
    assert agree(machine, found.tip, text, tmp_path) < 1e-12
    # whatever is no origin on the way is the same, byte for byte
    origin = rb"\s*<origin[^>]*?/?>"
    assert re.sub(origin, b"", text) == re.sub(origin, b"", ARM.encode())
    for kept in (
        'xyz="9 9 9"',
        'xyz="7 7 7"',
        "xyz=\"1 2 3\" rpy='0 0 1'",
        'xyz="0 .1 0"',
        'xyz="0 0 .1"',
        " />  <!-- kept",
    ):
        assert kept.encode() in text
    assert sm.Machine(found.description).name == machine.name


def test_nothing_is_changed_without_need(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_bytes(ARM.encode())
    machine = sm.import_urdf(file)
    assert corrected_urdf(machine.description, file) == (ARM.encode(), [])
    one = machine.with_effect("zero_offset", element="q4", error=2e-3)
    wanted = ARM.replace('"1e-1 0.02 0"/>', '"1e-1 0.02 0" rpy="0.002 0 0"/>')
    assert corrected_urdf(one.description, file)[0].decode() == wanted
    one = machine.with_effect("zero_offset", element="q1", error=0.05)  # a joint without an origin
    wanted = ARM.replace('<joint name="q1" type="revolute">\n    <parent', '<joint name="q1" type="revolute">\n    '
                         '<origin rpy="0 0 0.05"/>\n    <parent')  # fmt: skip
    assert corrected_urdf(one.description, file)[0].decode() == wanted
    tilted = machine.with_effect("axis_tilt", element="q1", angle_x=1e-3).with_effect(
        "axis_tilt", element="q4", angle_y=2e-3
    )
    assert agree_tilt(tilted, file, tmp_path) < 1e-12


@pytest.mark.parametrize("name", ["q.2", "q 4", "fl ange"])
def test_joints_beside_the_way_may_have_names_that_are_one_in_a_machine_file(
    name: str, tmp_path: Path
) -> None:
    beside = (
        ARM.replace('name="eye"', f'name="{name}"').replace('"q4"', '"q/4"').replace('"flange"', '"fl.ange"')
    )
    file = tmp_path / "arm.urdf"
    file.write_text(beside)
    one = sm.import_urdf(file, tip="tool0").with_effect("zero_offset", element="q_4", error=2e-3)
    wanted = beside.replace('"1e-1 0.02 0"/>', '"1e-1 0.02 0" rpy="0.002 0 0"/>')
    assert corrected_urdf(one.description, file)[0].decode() == wanted


def agree_tilt(machine: sm.Machine, file: Path, folder: Path) -> float:
    text, left = corrected_urdf(machine.description, file)
    assert left == []
    return agree(machine, "tool0", text, folder)


def test_what_an_origin_cannot_hold_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "arm.urdf", tmp_path / "corrected.urdf"
    file.write_bytes(ARM.encode())
    (tmp_path / "side.yaml").write_text(
        "actuators: {q1: {stiffness: 1e5}}\nsprings: {a: {stiffness: [1e6, 1e6, 1e6, 1e4, 1e4, 1e4]}}\n"
    )
    sm.import_urdf(file, tmp_path / "side.yaml").save(tmp_path / "m.yaml")
    call = [
        "compensate",
        str(tmp_path / "m.yaml"),
        "--urdf",
        str(file),
        "--effect",
        "zero_offset q3 error=1mm",
    ]
    more = ["--effect", "periodic_error q4 amplitude=1mrad period=1rad"]
    assert main([*call, *more, "-o", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["file"] == str(out)
    assert (
        said["not in the geometry"]
        == "arm.q1: compliance of the drive; arm.a: compliance; arm.q4: errors along its travel"
    )
    assert b'rpy="0.1 -1.57 3.14" xyz="' in out.read_bytes()
    for wrong in ([], ["-o", str(file)], ["-o", str(tmp_path / "c.csv"), "poses.csv"]):
        assert main([*call, *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1


OTHER = {
    "axis": (
        '<axis xyz="0 1 0"/>',
        '<axis xyz="1 0 0"/>',
        "expected its joint q_2 with the same type and axis",
    ),
    "length": ("0 0 0.40", "0 0 0.41", "the origin of joint q 2 is 0.01 off"),
    "name": ('"q4"', '"q5"', "expected its joint q4 .* found no such joint"),
    "added": ('type="fixed">\n', 'type="revolute">\n', "the machine has no joint fix"),
    "no xml": ("</robot>", "", "not XML"),
}


@pytest.mark.parametrize("name", OTHER)
def test_another_file_is_refused(name: str, tmp_path: Path) -> None:
    old, new, message = OTHER[name]
    file = tmp_path / "arm.urdf"
    file.write_bytes(ARM.encode())
    machine = sm.import_urdf(file)
    file.write_bytes(ARM.replace(old, new).encode())
    with pytest.raises(FileError, match=message) as caught:
        corrected_urdf(machine.description, file)
    assert str(file) in str(caught.value)


def test_a_calibrated_arm_in_its_own_file(tmp_path: Path) -> None:
    """From the file through readings and a calibration back to the file."""
    file, arm = tmp_path / "arm.urdf", str(tmp_path / "arm.yaml")
    tool = '<link name="tool0"/><joint name="t" type="fixed"><parent link="l6"/><child link="tool0"/></joint></robot>'
    file.write_text((CASES / "arm-wrist-straight.urdf").read_text().replace("</robot>", tool))
    at = sm.forward_kinematics(sm.import_urdf(file), BENT).position
    box = ", ".join(f"{a}: [{v - 0.2}, {v + 0.2}]" for a, v in zip("xyz", at, strict=True))
    home = ", ".join(f"j{i + 1}: {v}" for i, v in enumerate(BENT))
    (tmp_path / "side.yaml").write_text(f"home: {{{home}}}\nworkspace: {{{box}}}\n")
    assert main(["import", str(file), "--sidecar", str(tmp_path / "side.yaml"), "-o", arm]) == 0
    twin = ["simulate", arm, "--quantity", "position", "--poses", "40", "--read", "dx,dy,dz,rx,ry,rz"]
    off = ["--effect", "zero_offset j2 error=1mrad", "--effect", "length j3_origin error=0.5mm"]
    assert main([*twin, *off, "-o", str(tmp_path / "readings")]) == 0
    assert main(["calibrate", arm, str(tmp_path / "readings"), "-o", str(tmp_path / "result")]) in (0, 1)
    machine = sm.load_machine(tmp_path / "result" / "machine.yaml")
    text, left = corrected_urdf(machine.description, file)
    assert left == [f"arm.j{i}: errors along its travel" for i in range(1, 7)]  # gains
    assert agree(machine, "tool0", text, tmp_path) < 1e-12
    assert b'<joint name="t" type="fixed"><origin xyz="' in text
    assert real_tool(machine, dict.fromkeys((f"j{i}" for i in range(1, 7)), 0.0))[2, 3] > 1e-4


def test_robots_of_example_robot_data(tmp_path: Path) -> None:
    """Published robots."""
    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        pytest.skip("example-robot-data is not installed (pip install example-robot-data)")
    found = 0
    for file in [Path(str(f.locate())) for f in files if f.suffix == ".urdf"]:
        try:
            imported = import_urdf(file)
        except FileError:
            continue
        machine = bent(sm.Machine(imported.description), found)
        text, left = corrected_urdf(machine.description, file)
        assert left == [] and agree(machine, imported.tip, text, tmp_path) < 1e-12, file
        assert len(re.findall(rb"<", text)) >= len(re.findall(rb"<", file.read_bytes()))
        found += 1
    assert found > 20

"""Small URDF files."""

from __future__ import annotations

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="shoulder"><inertial><origin xyz="0.1 0 0.02" rpy="0 0 0.3"/><mass value="4"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"/>
  <link name="slide"><inertial><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"/>
  <joint name="q1" type="continuous"><origin xyz="0 0 0.3" rpy="0 0 0.2"/><axis xyz="0 0 1"/>
    <parent link="base"/><child link="shoulder"/></joint>
  <joint name="q2" type="revolute"><origin xyz="0.05 0 0.1" rpy="1.2 -0.3 0.7"/><axis xyz="0 1 1"/>
    <parent link="shoulder"/><child link="upper"/>
    <limit lower="-2" upper="2" effort="100" velocity="2"/></joint>
  <joint name="q3" type="revolute"><origin xyz="0.4 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <parent link="upper"/><child link="fore"/><limit lower="-2" upper="2" effort="80" velocity="2"/></joint>
  <joint name="q4" type="prismatic"><origin xyz="0.1 0 0" rpy="0 0.4 0"/><axis xyz="1 0 0"/>
    <parent link="fore"/><child link="slide"/><limit lower="0" upper="0.4" effort="60" velocity="1"/></joint>
  <joint name="flange" type="fixed"><origin xyz="0.08 0.01 0" rpy="0 1.57 0"/>
    <parent link="slide"/><child link="tool"/></joint>
</robot>
"""

ARM_SIDECAR = """
home: {q1: 0.2, q2: -0.4, q3: 0.9, q4: 0.1}
actuators:
  q1: {stiffness: 4.0e4}
  q2: {stiffness: 3.0e4}
  q3: {compliance: 5.0e-5}
  q4: {stiffness: 1.0e6}
springs:
  upper: {compliance: [1.0e-8, 1.0e-6, 1.0e-6, 1.0e-5, 1.0e-5, 1.0e-5]}
"""


def link(name: str) -> str:
    return f'<link name="{name}"/>'


def pin(name: str, parent: str, child: str, xyz: str) -> str:
    return (
        f'<joint name="{name}" type="revolute"><origin xyz="{xyz}"/><axis xyz="0 0 1"/>'
        f'<parent link="{parent}"/><child link="{child}"/>'
        '<limit lower="-3" upper="3" effort="50" velocity="3"/></joint>'
    )


def fixed(name: str, parent: str, child: str, xyz: str) -> str:
    return (
        f'<joint name="{name}" type="fixed"><origin xyz="{xyz}"/><parent link="{parent}"/>'
        f'<child link="{child}"/></joint>'
    )


FIVE_BAR = (
    '<robot name="fivebar">'
    + "".join(map(link, ("base", "arm_a", "fore_a", "tip_a", "arm_b", "fore_b", "tip_b")))
    + pin("motor_a", "base", "arm_a", "-0.15 0 0")
    + pin("elbow_a", "arm_a", "fore_a", "0.3 0 0")
    + fixed("end_a", "fore_a", "tip_a", "0.374 0 0")
    + pin("motor_b", "base", "arm_b", "0.15 0 0")
    + pin("elbow_b", "arm_b", "fore_b", "0.3 0 0")
    + fixed("end_b", "fore_b", "tip_b", "0.374 0 0")
    + "</robot>"
)

# as Gepetto's example-parallel-robots writes it, and what stiffness needs besides
FIVE_BAR_SIDECAR = """
closed_loop: [[tip_a, tip_b]]
type: [3d]
name_mot: [motor_a, motor_b]
joint_name: []
joint_type: []
home: {motor_a: 2.2143, elbow_a: -1.72434, motor_b: 0.92730, elbow_b: 1.72434}
task: [x, y]
actuators: {motor_a: {stiffness: 5.0e4}, motor_b: {stiffness: 5.0e4}}
springs:
  arm_a: &arm {stiffness: [7.0e8, 1.0e7, 1.0e7, 1.0e5, 1.0e5, 1.0e5]}
  arm_b: *arm
  fore_a: &fore {stiffness: [5.0e8, 5.0e6, 5.0e6, 1.0e5, 1.0e5, 1.0e5]}
  fore_b: *fore
"""

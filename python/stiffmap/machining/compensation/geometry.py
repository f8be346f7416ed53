"""The corrected machine as geometry that a controller can take: offsets as built, Denavit-Hartenberg rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import write_text
from stiffmap.model.description import Element, Joint, MachineDescription, Offset, Pose, Spring
from stiffmap.model.description.tree import edit_all
from stiffmap.solve.machine import Machine, takes_machine

PARALLEL = 0.05
"""rad: below it two axes count as parallel and their row has Hayati's fourth parameter: the common normal of
axes that are almost parallel runs away without end (S. A. Hayati, "Robot arm geometric link parameter
estimation", CDC 1983)."""
Frame = tuple[Floats, Floats]


@dataclass(frozen=True)
class DhRow:
    """One joint, m and rad: Rz(q + theta) Tz(d) Tx(a) Rx(alpha), or Rz(q + theta) Tx(a) Rx(alpha) Ry(beta)."""

    joint: str
    theta: float
    d: float
    a: float
    alpha: float
    beta: float | None = None
    """rad; given where the next axis is parallel, and d is then 0."""
    prismatic: bool = False


def corrected_geometry(description: MachineDescription) -> tuple[MachineDescription, list[str]]:
    """The machine whose *declared* geometry is the real one: what a controller should believe.

    Built offsets become nominal and zero errors become offsets before their joint. Second: what geometry
    cannot hold and `compensate` must, in words.
    """
    left = [f"{s.name}: a spring outside the legs" for s in description.external_springs]

    def part(elements: tuple[Element, ...], path: str) -> tuple[Element, ...]:
        out: list[Element] = []
        for e in elements:
            if isinstance(e, Offset):
                out.append(Offset(e.name, e.actual or e.nominal))
            elif isinstance(e, Joint):
                out += _joint(e, f"{path}.{e.name}", left)
            else:
                if isinstance(e, Spring):
                    left.append(f"{path}.{e.name}: compliance")
                out.append(e)
        return tuple(out)

    return replace(edit_all(description, part), effects=(), declared=None), left


def _joint(e: Joint, name: str, left: list[str]) -> list[Element]:
    offset = sum(c.offset for c in e.command_errors)
    if any(c.slope or c.amplitude or c.knots for c in e.command_errors) or e.guide_errors:
        left.append(f"{name}: errors along its travel")
    if e.law is not None:
        left.append(f"{name}: compliance of the drive")
    plain = replace(e, command_errors=(), guide_errors=())
    if not offset:
        return [plain]
    axis = np.array(e.axes[0])
    turn = Rotation.from_rotvec(offset * axis / np.linalg.norm(axis)).as_matrix()
    pose = Pose.of(offset * axis) if e.kind == "prismatic" else Pose.of(rotation=turn)
    return [Offset(f"{e.name}_zero", pose), plain]


def serial_joints(description: MachineDescription) -> tuple[list[tuple[Joint, Frame, Floats]], Frame]:
    """Joints of a serial arm with their frames and axes in base axes at zero coordinates, and the tool's frame.

    Nominal geometry. Raises StiffmapError for a machine with several legs, blocks or passive joints.
    """
    if len(description.legs) != 1:
        raise StiffmapError(
            f"{description.name}: a list of joints needs a serial arm; it has {len(description.legs)} legs"
        )
    p, r = np.zeros(3), np.eye(3)
    joints: list[tuple[Joint, Frame, Floats]] = []
    for e in (*description.base, *description.legs[0].elements, *description.platform):
        if isinstance(e, Offset):
            p, r = p + r @ e.nominal.p, r @ e.nominal.r
        elif isinstance(e, Joint):
            if not e.actuated:
                raise StiffmapError(
                    f"{description.name}: joint {e.name} is passive; a serial arm has drives only"
                )
            joints.append((e, (p, r), r @ np.array(e.axes[0])))
        elif hasattr(e, "branches"):
            raise StiffmapError(f"{description.name}: block {e.name} is no part of a serial arm")
    return joints, (p, r)


def dh_list(description: MachineDescription) -> tuple[Frame, list[DhRow], Frame]:
    """Base frame, one row per joint but the last, whose frame and the tool's are left: (p, R) of the first
    frame in base axes, rows, and (p, R) of the tool in the last row's frame turned by the last joint."""
    joints, (tool_p, tool_r) = serial_joints(description)
    _, (p, _), axis = joints[0]
    base = frame = (p, _with_z(axis))
    rows = []
    for k, (joint, _, _) in enumerate(joints[:-1]):
        _, (q, _), ahead = joints[k + 1]
        o, x = frame
        row, step = _row(joint, x.T @ (q - o), x.T @ ahead)
        rows.append(row)
        frame = (o + x @ step[0], x @ step[1])
    o, x = frame
    rows.append(DhRow(joints[-1][0].name, 0.0, 0.0, 0.0, 0.0, None, joints[-1][0].kind == "prismatic"))
    return base, rows, (x.T @ (tool_p - o), x.T @ tool_r)


@takes_machine
def write_dh(machine: Machine, path: str | PathLike[str]) -> list[str]:
    """Write `dh_list` of a corrected serial arm as CSV, mm and deg; what geometry cannot hold, in words.

    Raises StiffmapError for a machine that is no serial arm, FileError where the file cannot be written.
    """
    corrected, left = corrected_geometry(machine.description)
    (p, r), rows, (q, s) = dh_list(corrected)
    lines = ["joint,theta_deg,d_mm,a_mm,alpha_deg,beta_deg"]
    for row in rows:
        beta = "" if row.beta is None else f"{np.degrees(row.beta):.9g}"
        lines.append(
            f"{row.joint},{np.degrees(row.theta):.9g},{1e3 * row.d:.9g},{1e3 * row.a:.9g},{np.degrees(row.alpha):.9g},{beta}"
        )
    for name, shift, turn in (("base", p, r), ("tool", q, s)):
        cells = ",".join(f"{v:.9g}" for v in (*(1e3 * shift), *turn.ravel()))
        lines.append(f"# {name}: x y z in mm, rotation by rows,{cells}")
    write_text(Path(path), "\n".join(lines) + "\n")
    return left


def _with_z(z: Floats) -> Floats:
    z = z / np.linalg.norm(z)
    other = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = other - z * (z @ other)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _row(joint: Joint, q: Floats, z: Floats) -> tuple[DhRow, Frame]:
    """Row from a frame to the next axis: a point q on it and its direction z, both in the frame."""
    z = z / np.linalg.norm(z)
    slides = joint.kind == "prismatic"
    across = np.cross([0.0, 0.0, 1.0], z)
    size = float(np.linalg.norm(across))
    if size < np.sin(PARALLEL):
        foot = q - z * (q[2] / z[2])
        theta, a = float(np.arctan2(foot[1], foot[0])), float(np.hypot(foot[0], foot[1]))
        turned = Rotation.from_euler("z", theta).inv().apply(z)
        beta, alpha = float(np.arcsin(turned[0])), float(np.arctan2(-turned[1], turned[2]))
        r = Rotation.from_euler("ZXY", [theta, alpha, beta]).as_matrix()
        return DhRow(joint.name, theta, 0.0, a, alpha, beta, slides), (foot, r)
    x = across / size
    # o + d z0 + a x = q + s z
    d, a, _ = np.linalg.solve(np.column_stack([[0.0, 0.0, 1.0], x, -z]), q)
    theta, alpha = float(np.arctan2(x[1], x[0])), float(np.arctan2(size, z[2]))
    r = Rotation.from_euler("ZX", [theta, alpha]).as_matrix()
    row = DhRow(joint.name, theta, float(d), float(a), alpha, None, slides)
    return row, (np.array([0.0, 0.0, d]) + a * x, r)

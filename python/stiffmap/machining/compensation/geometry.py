"""The corrected machine as geometry that a controller can take: offsets as built, Denavit-Hartenberg rows, the URDF of an arm."""

from __future__ import annotations

import re
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.outputs import write_text, writing
from stiffmap.experiment.spreadsheet.dh import DHRow
from stiffmap.machining.toolpath.gcode.words import decimal
from stiffmap.model.description import Element, Joint, MachineDescription, Offset, Pose, Spring
from stiffmap.model.description.tree import edit_all
from stiffmap.model.urdf.chains import plain_name
from stiffmap.model.urdf.editing import SAME, with_origins
from stiffmap.model.urdf.model import UrdfModel
from stiffmap.model.urdf.reader import read_urdf
from stiffmap.solve.machine import Machine, takes_machine

PARALLEL = 0.05
"""rad: below it two axes count as parallel and their row has Hayati's fourth parameter: the common normal of
axes that are almost parallel runs away without end (S. A. Hayati, "Robot arm geometric link parameter
estimation", CDC 1983)."""
Frame = tuple[Floats, Floats]
DIGITS = 9
"""Decimals of mm and deg in a table of Denavit and Hartenberg, and of rotations."""


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
    if e.sag:
        left.append(f"{name}: sag of the drive")
    if e.law is not None:
        left.append(f"{name}: compliance of the drive")
    plain = replace(e, sag=0.0, command_errors=(), guide_errors=())
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


def dh_list(description: MachineDescription) -> tuple[Frame, list[DHRow], Frame]:
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
    rows.append(DHRow(joints[-1][0].name, 0.0, 0.0, 0.0, 0.0, joints[-1][0].kind == "prismatic"))
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
        numbers = np.degrees(row.theta), 1e3 * row.d, 1e3 * row.a, np.degrees(row.alpha)
        beta = "" if row.beta is None else decimal(np.degrees(row.beta), DIGITS)
        lines.append(",".join([row.name, *(decimal(v, DIGITS) for v in numbers), beta]))
    for name, shift, turn in (("base", p, r), ("tool", q, s)):
        cells = ",".join(decimal(v, DIGITS) for v in (*(1e3 * shift), *turn.ravel()))
        lines.append(f"# {name}: x y z in mm, rotation by rows,{cells}")
    write_text(Path(path), "\n".join(lines) + "\n")
    return left


def _with_z(z: Floats) -> Floats:
    z = z / np.linalg.norm(z)
    other = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = other - z * (z @ other)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _row(joint: Joint, q: Floats, z: Floats) -> tuple[DHRow, Frame]:
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
        return DHRow(joint.name, theta, 0.0, a, alpha, slides, beta=beta), (foot, r)
    x = across / size
    # o + d z0 + a x = q + s z
    d, a, _ = np.linalg.solve(np.column_stack([[0.0, 0.0, 1.0], x, -z]), q)
    theta, alpha = float(np.arctan2(x[1], x[0])), float(np.arctan2(size, z[2]))
    r = Rotation.from_euler("ZX", [theta, alpha]).as_matrix()
    row = DHRow(joint.name, theta, float(d), float(a), alpha, slides)
    return row, (np.array([0.0, 0.0, d]) + a * x, r)


CLOSE = 1e-9  # m, and of a rotation matrix: a machine file's digits


@takes_machine
def write_urdf(machine: Machine, urdf: str | PathLike[str], path: str | PathLike[str]) -> list[str]:
    """Write the URDF of an imported arm as `corrected_urdf` makes it; what no origin can hold, in words. Raises as that does."""
    text, left = corrected_urdf(machine.description, urdf)
    with writing(Path(path)) as fresh:
        fresh.write_bytes(text)
    return left


def corrected_urdf(description: MachineDescription, urdf: str | PathLike[str]) -> tuple[bytes, list[str]]:
    """The URDF of an imported arm with the origins of its joints as they really are (m, rad), a zero error as a turn or
    shift of the joint's origin; every other byte is the file's. Second: what no origin can hold, in words.

    Raises FileError where the file cannot be read or is not that of the machine, StiffmapError for a machine that is no
    serial arm.
    """
    model = read_urdf(Path(urdf))
    corrected, left = corrected_geometry(description)
    serial_joints(description)
    declared, _ = _origins(description, model)
    _check(description, model, declared)
    real, tool = _origins(corrected, model)
    if _apart(tool, Pose()) > SAME:
        left.append("the tool's frame: no fixed joint of the file with an origin holds it")
    changed = {j: (declared[j], real[j]) for j in real if _apart(declared[j], real[j]) > SAME}
    return with_origins(Path(urdf), changed), left


def _apart(a: Pose, b: Pose) -> float:
    return float(max(np.abs(a.p - b.p).max(), np.abs(a.r - b.r).max()))


def _origins(description: MachineDescription, model: UrdfModel) -> tuple[dict[str, Pose], Pose]:
    """Origin of each joint of the file that the arm's declared geometry speaks of, and what follows the last of them."""
    said = re.search(r" to (\S+)", description.source)  # the tip, as the import writes it
    way = model.way(said[1] if said else "")
    known = {plain_name(j.name): j for j in way or model.above.values()}
    out: dict[str, Pose] = {}
    here, after = "", Pose()
    for e in (*description.base, *description.legs[0].elements, *description.platform):
        if not isinstance(e, Joint | Offset):
            continue
        own = known.get(
            e.name if isinstance(e, Joint) else e.name.removesuffix("_zero").removesuffix("_origin")
        )
        if isinstance(e, Joint) and (
            own is None or own.kind != e.kind or np.abs(np.subtract(e.axes[0], own.axis)).max() >= CLOSE
        ):
            raise _other(description, model, f"expected its joint {e.name} with the same type and axis, "
                         f"found {'no such joint' if own is None else 'another one'}")  # fmt: skip
        if own is not None and own.name not in out:
            out[own.name], here, after = after, own.name, Pose()
        if isinstance(e, Joint):
            here = ""
        elif here:
            out[here] = out[here] @ e.nominal
        else:
            after = after @ e.nominal
    for joint in way:
        if joint.name not in out and joint.kind == "fixed" and joint.parent == model.joints[[*out][-1]].child:
            out[joint.name], after = after, Pose()
    return out, after


def _check(description: MachineDescription, model: UrdfModel, declared: dict[str, Pose]) -> None:
    """FileError where the declared origins are not those of the file on the way to the last joint."""
    way = model.way(model.joints[[*declared][-1]].child)
    moving = [e.name for e, _, _ in serial_joints(description)[0]]
    for joint in way:
        if joint.kind != "fixed" and plain_name(joint.name) not in moving:
            raise _other(description, model, f"the machine has no joint {joint.name}")
        off = _apart(declared.get(joint.name, Pose()), joint.origin)
        if off > CLOSE:
            raise _other(
                description,
                model,
                f"the origin of joint {joint.name} is {off:.2g} off (m, or of its rotation)",
            )
    if [j.name for j in way if j.name in declared] != [*declared]:
        raise _other(description, model, f"its joints follow each other as {', '.join(declared)}")


def _other(description: MachineDescription, model: UrdfModel, found: str) -> FileError:
    return FileError(
        f"this is not the URDF that {description.name} was imported from: {found}", file=model.file
    )

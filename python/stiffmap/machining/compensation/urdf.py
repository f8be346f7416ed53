"""A corrected arm in the URDF that it was imported from."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.common.outputs import writing
from stiffmap.machining.compensation.geometry import corrected_geometry, serial_joints
from stiffmap.model.description import Joint, MachineDescription, Offset, Pose
from stiffmap.model.urdf.chains import plain_name
from stiffmap.model.urdf.editing import SAME, with_origins
from stiffmap.model.urdf.model import UrdfModel
from stiffmap.model.urdf.reader import read_urdf
from stiffmap.solve.machine import Machine, takes_machine

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

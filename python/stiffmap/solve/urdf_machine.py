"""A machine from a URDF file."""

from __future__ import annotations

from os import PathLike

from stiffmap.model.urdf.importing import import_urdf as description_of
from stiffmap.solve.machine import Machine


def import_urdf(
    urdf: str | PathLike[str], sidecar: str | PathLike[str] | None = None, *, tip: str | None = None
) -> Machine:
    """Machine (SI) of a URDF file: a serial chain from the root link to the tip, or legs in parallel with a sidecar.

    urdf
        The URDF file.
    sidecar
        YAML file with what a URDF lacks: closed loops, motors, compliances, workspace. None: all motors are rigid.
    tip
        Link that is the tool. None: that of the sidecar, or the one that has the name of a tool (tool0, tcp, tool, ee,
        flange), or the only end; `machine.description.source` says which.

    Joints that are not on the way to the tip are left out, and stand at zero; what they carry stays as a mass on the
    body that they hang on. `stiffmap.model.urdf.import_urdf` returns the description and what was left out. Raises FileError, one line, for what cannot be used.
    """
    return Machine(description_of(urdf, sidecar, tip=tip).description)

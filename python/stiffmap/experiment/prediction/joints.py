"""Joints under a plan: what encoders read, on the load side and on the motor side of a drive, and where drives with play or dry
friction stand without load: on the side from which they came."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of, drive_jacobian
from stiffmap.model.description import CommandError, Element, Joint, MachineDescription
from stiffmap.model.description.tree import all_elements, core_name, edit, joints, of_same_sequence
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

TRAVEL = 1e-3
"""m along the approach over which drives are asked for their direction."""
STILL = 1e-3
"""Share of the fastest drive's travel below which a drive counts as not moved."""


def joint_motions(machine: Machine, plan: Experiment, coordinates: Floats, names: tuple[str, ...]) -> Floats:
    """(n, joints) m, rad: how far joints are from where the command puts them.

    coordinates
        (n, coordinates) of the equilibria. ``load``: the coordinate less the commanded one. ``motor``:
        the elastic part of it, of which an effect says the share that the motor's encoder sees.
    """
    rigid = coordinates_of(machine, plan)
    out = []
    for c in joint_channels(plan):
        i = names.index(c.joint)
        moved = coordinates[:, i] - rigid[:, i]
        out.append(moved - _command_error(machine, c.joint, rigid) if c.side == "motor" else moved)
    return np.column_stack(out)


def joint_channels(plan: Experiment) -> list[Channel]:
    """Channels that are joints."""
    return [c for c in plan.extra if c.joint]


def _command_error(machine: Machine, name: str, rigid: Floats) -> Floats:
    """(n,) m, rad: the errors of a drive's command where all joints stand without load (n, coordinates)."""
    joint, out = joints(machine.description).get(name), np.zeros(len(rigid))
    for e in joint.command_errors if joint else ():
        of = of_same_sequence(name, e.of) if e.of else name
        i = machine.compiled.names.joints[of]
        out = out + _error(e, rigid[:, i], float(machine.compiled.home_coordinates()[i]))
    return out


def _error(e: CommandError, u: Floats, home: float) -> Floats:
    travel = u - (home if e.reference is None else e.reference)
    wave = np.sin(2 * math.pi * travel / e.period + e.phase)
    knots = np.array(e.knots or ((0.0, 0.0),))
    between = np.interp(u, knots[:, 0], knots[:, 1])
    return np.asarray(e.offset + e.slope * travel + e.amplitude * wave + between)


def check_joints(machine: Machine, experiment: Experiment) -> None:
    """Raises StiffmapError for joints that the machine does not have, or that read another unit."""
    names = machine.compiled.names
    for c in (*joint_channels(experiment), *experiment.command_of):
        if c.joint not in names.joints:
            raise StiffmapError(
                f"{experiment.name}: column {c.name}: machine {machine.name} has no joint '{c.joint}'; "
                f"it has {', '.join(names.joints)}"
            )
        if c.side == "motor" and c.joint not in machine.actuators:
            raise StiffmapError(f"{experiment.name}: column {c.name}: {c.joint} has no motor")
        if (c.unit == "m") != names.is_prismatic(c.joint):
            expected = "a length" if names.is_prismatic(c.joint) else "an angle"
            raise StiffmapError(f"{experiment.name}: column {c.name}: {c.joint} reads {expected}")


def lag(joint: Joint) -> float:
    """How far a drive without load stays behind its motor: half the gap, and friction over stiffness."""
    law = joint.law
    if not joint.actuated or law is None:
        return 0.0
    return float(max((a for a, f in law.knots if f == 0.0), default=0.0) + law.friction / law.stiffness)


def is_sided(description: MachineDescription, plan: Experiment) -> bool:
    """Whether the state without load depends on the approach."""
    sided = plan.quantity == "position" or plan.unloaded == "approach"
    return sided and plan.approach is not None and lags(description)


def lags(description: MachineDescription) -> bool:
    """Whether any drive stays behind."""
    return any(lag(joint) > 0 for joint in joints(description).values())


def signs(machine: Machine, experiment: Experiment) -> Floats:
    """(n, actuators) direction of each drive's last travel, +1, -1, or 0 where it did not move."""
    assert experiment.approach is not None
    length = np.linalg.norm(experiment.approach, axis=1, keepdims=True)
    back = TRAVEL * experiment.approach / np.where(length > 0, length, 1.0)
    moved = np.nan_to_num(_travels(machine, experiment, back))
    top = np.abs(moved).max(axis=1, keepdims=True)
    return np.asarray(np.where(np.abs(moved) > STILL * np.where(top > 0, top, 1.0), np.sign(moved), 0.0))


def _travels(machine: Machine, experiment: Experiment, back: Floats) -> Floats:
    """(n, actuators) travel of each drive over the last way `back` (n, 3) m to the pose."""
    if experiment.joints is None:
        here = inverse_kinematics(machine, experiment.position, experiment.rotation).actuators
        there = inverse_kinematics(machine, experiment.position - back, experiment.rotation).actuators
        return np.asarray(here - there)
    twist = np.hstack([back, np.zeros_like(back)])
    drives = np.linalg.pinv(np.nan_to_num(drive_jacobian(machine, experiment)))
    return np.asarray(np.einsum("nai,ni->na", drives, twist))


def lagging(machine: Machine, sign: Floats, weighs: bool = False) -> Machine:
    """The machine with each drive (actuators,) behind by its lag and free of play and friction.

    Where the machine `weighs`, its weight closes the gaps: only friction is behind then.
    """
    way = dict(zip(machine.actuators, sign.tolist(), strict=True))
    d = machine.description
    for name, element in all_elements(d):
        if isinstance(element, Joint) and lag(element) > 0:
            behind = partial(_behind, sign=way.get(core_name(name), 0.0), weighs=weighs)
            d = edit(d, name, behind) or d
    return Machine(replace(d, effects=(), declared=None), like=machine)


def _behind(joint: Element, sign: float, weighs: bool) -> Element | None:
    """A drive that lags on one side."""
    if not isinstance(joint, Joint) or joint.law is None:
        return None
    law = joint.law
    behind = law.friction / law.stiffness if weighs else lag(joint)
    free = replace(law, friction=0.0) if weighs else replace(law, friction=0.0, knots=())
    errors = (*joint.command_errors, CommandError(offset=-sign * behind))
    return replace(joint, law=free, command_errors=errors)

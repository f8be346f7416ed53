"""Joint coordinates that encoders read, on the load side and on the motor side of a drive."""

from __future__ import annotations

import math

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.model.description import CommandError
from stiffmap.model.description.tree import joints, of_same_sequence
from stiffmap.solve.machine import Machine


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

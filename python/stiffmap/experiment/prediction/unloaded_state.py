"""Where drives with play or dry friction stand without load: on the side from which they came."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import drive_jacobian
from stiffmap.model.description import CommandError, Element, Joint, MachineDescription
from stiffmap.model.description.tree import all_elements, core_name, edit, joints
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

TRAVEL = 1e-3
"""m along the approach over which drives are asked for their direction."""
STILL = 1e-3
"""Share of the fastest drive's travel below which a drive counts as not moved."""


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
    return np.asarray(
        np.einsum("nai,ni->na", np.linalg.pinv(np.nan_to_num(drive_jacobian(machine, experiment))), twist)
    )


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

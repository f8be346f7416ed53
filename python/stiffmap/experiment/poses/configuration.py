"""Where all joints of the rigid machine stand in each row of a plan."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats, Integers, Mask
from stiffmap.experiment.poses.once import Once
from stiffmap.model.description.rigid import straight
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine


def coordinates_of(machine: Machine, plan: Experiment) -> Floats:
    """(n, coordinates) m, rad: springs at rest; NaN where the pose is out of reach.

    Where joints are commanded they are taken as they are, in whichever branch that is. `machine` may have
    effects that the machine did not have on which the plan was `located`: joints go by name.
    """
    if plan.joints is None:
        once, back = poses_once(plan)
        return inverse_kinematics(machine, once.position, once.rotation).coordinates[back]
    known = {name: i for i, name in enumerate(plan.joint_names)}
    names = machine.compiled.names.coordinates
    out = np.tile(machine.compiled.home_coordinates(), (len(plan), 1))
    mine = [i for i, name in enumerate(names) if name in known]
    out[:, mine] = plan.joints[:, [known[names[i]] for i in mine]]
    return out


def poses_once(plan: Experiment) -> tuple[Experiment, Integers]:
    """Rows with each commanded pose once, and (n,) which of them stands for each row."""
    if plan.command is None and plan.joints is None:
        return plan.each_pose, plan.groups
    return plan, np.arange(len(plan))


def in_reach(machine: Machine, plan: Experiment) -> Mask:
    """(n,) rows whose commanded pose the rigid machine can take; found out once for all machines of one geometry;
    not to be written to."""
    if plan.joints is not None:
        return np.asarray(np.isfinite(plan.joints).all(axis=1))
    return _REACH.get(plan, machine, lambda: _reached(machine, plan))


_REACH: Once[Mask] = Once()


def _reached(machine: Machine, plan: Experiment) -> Mask:
    plain = straight(machine.description)  # a gap without force has no stiffness, and would leave the kernels
    if plain is not machine.description:
        machine = Machine(plain, like=machine)
    out = np.zeros(len(plan), bool)
    if not machine.compiled.not_fast:  # where the kernels stand at rest the joints close, twenty times faster
        out = machine.solve(plan.position, np.zeros((len(plan), 6)), rotation=plan.rotation).ok.copy()
    left = np.flatnonzero(~out)
    if len(left):
        out[left] = np.isfinite(coordinates_of(machine, plan.rows(left))).all(axis=1)
    return out

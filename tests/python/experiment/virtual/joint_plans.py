"""Plans whose rows are commanded by joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.experiment import Experiment
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.virtual.plans import plan_of_poses
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine


def plan_of_joints(
    machine: Machine,
    joints: Floats,
    *,
    axes: Sequence[str] = AXES[:3],
    noise: float | None = None,
    angle_noise: float = 1e-5,
) -> Experiment:
    """Positions without a load where the drives are commanded (n, drives), in the order of `machine.actuators`."""
    at = forward_kinematics(machine, joints)
    plan = plan_of_poses(
        machine, "position", at.position, np.zeros((1, 6)), axes=axes, noise=noise, angle_noise=angle_noise
    )
    names = tuple(machine.actuators)
    return replace(plan, rotation=at.rotation, rotation_against="base", joints=joints, joint_names=names)

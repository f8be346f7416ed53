"""Where all joints of the rigid machine stand in each row of a plan."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.kinematics import inverse_kinematics
from stiffmap.machine import Machine


def coordinates_of(machine: Machine, plan: Experiment) -> Floats:
    """(n, coordinates) m, rad: springs at rest; NaN where the pose is out of reach.

    Where joints are commanded they are taken as they are, in whichever branch that is. `machine` may have
    effects that the machine did not have on which the plan was `located`: joints go by name.
    """
    if plan.joints is None:
        return inverse_kinematics(machine, plan.position, plan.rotation).coordinates
    known = {name: i for i, name in enumerate(plan.joint_names)}
    names = machine.compiled.names.coordinates
    out = np.tile(machine.compiled.home_coordinates(), (len(plan), 1))
    mine = [i for i, name in enumerate(names) if name in known]
    out[:, mine] = plan.joints[:, [known[names[i]] for i in mine]]
    return out


def in_reach(machine: Machine, plan: Experiment) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """(n,) rows whose commanded pose the rigid machine can take."""
    if plan.joints is not None:
        return np.asarray(np.isfinite(plan.joints).all(axis=1))
    return np.asarray(np.isfinite(coordinates_of(machine, plan)).all(axis=1))

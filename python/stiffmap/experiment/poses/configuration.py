"""Where the rigid machine stands in each row of a plan: its joints, its named points, how its tool follows each drive; and which
points the metrology loop takes: what carries the instrument, the target, the reaction.

What is found once holds for a plan and all machines of one nominal geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Mask
from stiffmap.common.kept import Kept
from stiffmap.experiment.experiment import Experiment, Floats, Integers, Loop
from stiffmap.model.description import Element, Point, Spring
from stiffmap.model.description.alike import nominal_geometry, straight
from stiffmap.model.effects import get, kinds
from stiffmap.solve.closing import of_drives
from stiffmap.solve.kinematics import forward_kinematics, inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.solution import Solution

Array = TypeVar("Array", bound=NDArray[Any])
KEPT = 32
"""Arrays of one plan: a fit that moves a nominal point makes another geometry with every trial."""
STEP = 1e-6
"""m or rad of a drive to either side."""
BASE, PLATFORM = "base.rig_on_base", "platform.rig_on_platform"
"""Points of the metrology loop."""


def _once(make: Callable[..., Array]) -> Callable[..., Array]:
    """The same, found out once for a plan and all machines of one geometry; the last ones are kept as long as the plan lives."""
    known: WeakKeyDictionary[Experiment, Kept[Hashable, Array]] = WeakKeyDictionary()

    @wraps(make)
    def found(machine: Machine, plan: Experiment, *names: str) -> Array:
        def frozen() -> Array:
            made = make(machine, plan, *names)
            made.flags.writeable = False
            return made

        key = names, nominal_geometry(machine.description)
        return known.setdefault(plan, Kept(KEPT)).made(key, frozen)

    return found


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


def at_rest(machine: Machine, plan: Experiment) -> Solution:
    """The machine at the poses of a plan without load, its gaps closed: one without force has no stiffness, and would leave the
    kernels."""
    plain = straight(machine.description)
    if plain is not machine.description:
        machine = Machine(plain, like=machine)
    return machine.solve(plan.position, np.zeros((len(plan), 6)), rotation=plan.rotation)


@_once
def in_reach(machine: Machine, plan: Experiment) -> Mask:
    """(n,) rows whose commanded pose the rigid machine can take; not to be written to."""
    if plan.joints is not None:
        return np.asarray(np.isfinite(plan.joints).all(axis=1))
    out = np.zeros(len(plan), bool)
    if not machine.compiled.not_fast:  # where the kernels stand at rest the joints close, twenty times faster
        out = at_rest(machine, plan).ok.copy()
    left = np.flatnonzero(~out)
    if len(left):
        out[left] = np.isfinite(coordinates_of(machine, plan.rows(left))).all(axis=1)
    return out


def point_positions(machine: Machine, name: str, plan: Experiment) -> Floats:
    """(n, 3) m, base axes, of a point where each row is commanded; NaN where that is out of reach; not to be written to."""
    return plan.position if name == "tcp" else _point(machine, plan, name)


def positions_of(machine: Machine, plan: Experiment) -> Floats:
    """(n, 3) m, where the point that is read in each row is as commanded."""
    read = targets(machine, plan)
    at = {p: point_positions(machine, p, plan) for p in set(read)}
    return np.stack([at[p][i] for i, p in enumerate(read)])


@_once
def _point(machine: Machine, plan: Experiment, name: str) -> Floats:
    found = coordinates_of(machine, plan)
    at = machine.compiled.core.point_positions(name, np.ascontiguousarray(found))["position"]
    return np.where(np.asarray(np.isfinite(found).all(axis=1))[:, None], at, np.nan)


@_once
def drive_jacobian(machine: Machine, plan: Experiment) -> Floats:
    """(n, 6, actuators) twist of the TCP per unit of each drive of the rigid machine, in the plan's branch.

    NaN in a column where the drive cannot move to both sides; not to be written to.
    """
    plan, back = poses_once(plan)
    start = coordinates_of(machine, plan)
    drives = of_drives(machine.compiled, start)
    columns = []
    for k in range(drives.shape[-1]):
        unit = STEP * np.eye(drives.shape[-1])[k]
        up, down = (forward_kinematics(machine, drives + s * unit, start=start) for s in (1, -1))
        between = up.rotation @ np.swapaxes(down.rotation, 1, 2)
        lost = ~np.asarray(np.isfinite(between).all(axis=(1, 2)))[:, None, None]
        turn = Rotation.from_matrix(np.where(lost, np.eye(3), between)).as_rotvec()
        turn = np.where(lost[:, 0], np.nan, turn)
        columns.append(np.hstack([up.position - down.position, turn]) / (2 * STEP))
    return np.stack(columns, axis=-1)[back]


def rigged(machine: Machine, loop: Loop) -> Machine:
    """The machine with a point behind the base's elements and one before the tool's holder, where the
    loop needs them."""
    d = machine.description
    if "base" in (loop.instrument_on, loop.force_against) and _yields(d.base):
        d = replace(d, base=(*d.base, Point(BASE.removeprefix("base."))))
    if loop.target_on == "platform" and _yields(d.platform):
        holders = tuple(k for k in kinds() if get(k).behind_platform)  # with which their names begin
        at = next((i for i, e in enumerate(d.platform) if e.name.startswith(holders)), len(d.platform))
        d = replace(
            d, platform=(*d.platform[:at], Point(PLATFORM.removeprefix("platform.")), *d.platform[at:])
        )
    return machine if d is machine.description else Machine(d, like=machine)


def _yields(elements: tuple[Element, ...]) -> bool:
    return any(isinstance(e, Spring) for e in elements)


def carrier(machine: Machine, where: str) -> str:
    """Point that moves with what `where` names; empty for what does not move."""
    if where == "base":
        return BASE if BASE in machine.points else ""
    return "" if where == "floor" else where


def targets(machine: Machine, experiment: Experiment) -> tuple[str, ...]:
    """(n,) point that is read in each row; on the platform instead of the tool where the loop says so."""
    points = experiment.points or (experiment.point,) * len(experiment)
    if PLATFORM not in machine.points:
        return points
    return tuple(PLATFORM if p == "tcp" else p for p in points)

"""Readings that depend on the rows before: effects with a `drive`, such as `hysteresis`.

The drive's extra deflection moves the tool by the rigid machine's Jacobian.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stiffmap.description import AppliedEffect
from stiffmap.description.tree import joints
from stiffmap.effects.check import values_at
from stiffmap.effects.evidence import Drive
from stiffmap.effects.registry import get
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.poses.point_kinematics import point_positions
from stiffmap.experiment.prediction.metrology_loop import targets
from stiffmap.experiment.prediction.unloaded_state import drive_jacobian
from stiffmap.experiment.readings import Seen, kind_of
from stiffmap.machine import Machine
from stiffmap.options import SolveOptions


@dataclass(frozen=True, eq=False)
class Drives:
    """What the memory of the drives does not change: solved once for all values of their hysteresis."""

    machine: Machine
    effort: Floats
    """(n, actuators) drive on leg, N or N·m."""
    jacobian: Floats
    """(n, 6, actuators) twist of the tool per unit of each drive."""


def drives_of(machine: Machine, plan: Experiment) -> Drives:
    """Efforts and Jacobian at a plan's rows."""
    return Drives(machine, _efforts(machine, plan), drive_jacobian(machine, plan))


def history_motion(drives: Drives, plan: Experiment, terms: tuple[AppliedEffect, ...]) -> Floats:
    """(n, c) m, rad that terms with a `drive` add to the motions of the machine under a plan.

    Raises StiffmapError without an order of time, and for distances.
    """
    if plan.order is None:
        raise StiffmapError(f"{plan.name}: {terms[0].kind} needs the column 'order': rows in order of time")
    if any(kind.pair for c in plan.extra if (kind := kind_of(c))):
        raise StiffmapError(
            f"{plan.name}: {terms[0].kind} cannot be predicted for distances between two poses"
        )
    machine = drives.machine
    out = np.zeros((len(plan), len(plan.channels)))
    for term in terms:
        effect = get(term.kind)
        assert effect.drive is not None
        values = values_at(effect, machine.description.declared or machine.description, term)
        for name in _drives(machine, term):
            k = machine.actuators.index(name)
            more = _extra(machine, plan, name, -drives.effort[:, k], values, effect.drive)
            out += _seen(machine, plan, name, drives.jacobian[:, :, k], more)
    return out


def _efforts(machine: Machine, plan: Experiment) -> Floats:
    """(n, actuators) of the drives on their legs."""
    start = coordinates_of(machine, plan)
    drives = [machine.compiled.names.joints[a] for a in machine.actuators]
    points = plan.load_points or (plan.load_point,) * len(plan)
    gravity = np.zeros((len(plan), 0)) if plan.gravity_of is None else plan.gravity_of
    out = np.empty((len(plan), len(drives)))
    for key in dict.fromkeys(zip(points, map(tuple, gravity.tolist()), strict=True)):
        here = [i for i, k in enumerate(zip(points, map(tuple, gravity.tolist()), strict=True)) if k == key]
        options = SolveOptions(start=start[here], gravity=key[1] or plan.gravity, point=key[0])
        found = machine.solve_joints(start[here][:, drives], plan.wrench[here], options=options)
        out[here] = found.actuator_effort
    return out


def _drives(machine: Machine, term: AppliedEffect) -> list[str]:
    wanted = [f"{leg}.{term.element}" for leg in term.legs] or [term.element]
    return [a for a in machine.actuators if a in wanted or (not term.legs and a.endswith(f".{term.element}"))]


def _extra(
    machine: Machine, plan: Experiment, name: str, force: Floats, values: Mapping[str, float], drive: Drive
) -> Floats:
    """(n,) deflection beyond that of the machine's own spring, set-up by set-up in order of time."""
    law = joints(machine.description)[name].law
    assert law is not None and plan.order is not None
    compliance = 1.0 / law.stiffness
    out = np.empty(len(plan))
    for setup in np.unique(plan.runs):
        here = np.flatnonzero(plan.runs == setup)
        run = here[np.argsort(plan.order[here], kind="stable")]
        out[run] = drive(force[run], compliance, values) - compliance * force[run]
    return out


def _seen(machine: Machine, plan: Experiment, name: str, column: Floats, more: Floats) -> Floats:
    """(n, c) what every channel shows of a drive's extra deflection."""
    twist = column * more[:, None]
    read = targets(machine, plan)
    at = {p: point_positions(machine, p, plan) for p in set(read)}
    arm = np.stack([at[p][i] for i, p in enumerate(read)]) - plan.position
    linear = twist[:, :3] + np.cross(twist[:, 3:], arm)
    out = np.zeros((len(plan), len(plan.channels)))
    out[:, :6] = np.hstack([linear, twist[:, 3:]])
    for i, c in enumerate(plan.channels):
        if kind := kind_of(c):
            out[:, i] = kind.change(Seen(plan, out[:, :6], lambda: plan.position + arm), None)
        elif c.joint == name and c.side == "load":
            out[:, i] = more
    return out

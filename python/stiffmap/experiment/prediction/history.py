"""Readings that depend on the rows before: effects with a `drive`, such as `hysteresis`.

The drive's extra deflection moves the tool by the rigid machine's Jacobian.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import drive_jacobian, positions_of
from stiffmap.experiment.prediction.equilibria import solved
from stiffmap.experiment.prediction.metrology_loop import targets
from stiffmap.experiment.readings import Seen, kind_of
from stiffmap.model.description import AppliedEffect
from stiffmap.model.description.tree import joints
from stiffmap.model.effects.apply import values_at
from stiffmap.model.effects.evidence import Drive
from stiffmap.model.effects.registry import get
from stiffmap.solve.machine import Machine
from stiffmap.solve.options import SolveOptions


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
    points = plan.load_points or (plan.load_point,) * len(plan)
    gravity = np.zeros((len(plan), 0)) if plan.gravity_of is None else plan.gravity_of
    keys = list(zip(points, map(tuple, gravity.tolist()), strict=True))
    out = np.empty((len(plan), len(machine.actuators)))
    for key in dict.fromkeys(keys):
        here = np.array([i for i, k in enumerate(keys) if k == key])
        once, back = (plan if len(here) == len(plan) else plan.rows(here)).distinct
        options = SolveOptions(gravity=key[1] or plan.gravity, point=key[0])
        out[here] = solved(machine, once, options).actuator_effort[back]
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
    arm = positions_of(machine, plan, targets(machine, plan)) - plan.position
    linear = twist[:, :3] + np.cross(twist[:, 3:], arm)
    out = np.zeros((len(plan), len(plan.channels)))
    out[:, :6] = np.hstack([linear, twist[:, 3:]])
    for i, c in enumerate(plan.channels):
        if kind := kind_of(c):
            out[:, i] = kind.change(Seen(plan, out[:, :6], lambda: plan.position + arm), None)
        elif c.joint == name and c.side == "load":
            out[:, i] = more
    return out

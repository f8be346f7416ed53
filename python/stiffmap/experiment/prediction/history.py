"""Readings that depend on what the rows record: on their order, by effects with a `drive` such as `hysteresis`, or on a number
such as a temperature.

The drive's extra deflection moves the tool by the rigid machine's Jacobian. With a number, motions are solved at three values of
the record and interpolated between them. Growth by heat is a strain of about 1e-5 per kelvin; what a parabola through three
temperatures leaves out is of third order in it, far below any reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import drive_jacobian, positions_of
from stiffmap.experiment.prediction.equilibria import solved
from stiffmap.experiment.readings import Seen, kind_of
from stiffmap.model.description import AppliedEffect
from stiffmap.model.description.tree import joints
from stiffmap.model.effects.apply import values_at
from stiffmap.model.effects.evidence import Drive
from stiffmap.model.effects.registry import get
from stiffmap.solve.machine import Machine
from stiffmap.solve.options import SolveOptions

Terms = tuple[AppliedEffect, ...]
Solve = Callable[[Experiment, Terms], Floats]


@dataclass(frozen=True, eq=False)
class Drives:
    """What the memory of the drives does not change: solved once for all values of their hysteresis."""

    machine: Machine
    effort: Floats
    """(n, actuators) drive on leg, N or N·m."""
    jacobian: Floats
    """(n, 6, actuators) twist of the tool per unit of each drive."""

    @staticmethod
    def of(machine: Machine, plan: Experiment) -> Drives:
        """Those at a plan's rows."""
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
            out += _shown_of_drive(machine, plan, name, drives.jacobian[:, :, k], more)
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


def _shown_of_drive(machine: Machine, plan: Experiment, name: str, column: Floats, more: Floats) -> Floats:
    """(n, c) m, rad: what every channel shows where a drive stands off by `more` (n,) m or rad, which moves the tool by `column`
    (n, 6) per unit."""
    twist = column * more[:, None]
    arm = positions_of(machine, plan) - plan.position
    linear = twist[:, :3] + np.cross(twist[:, 3:], arm)
    out = np.zeros((len(plan), len(plan.channels)))
    out[:, :6] = np.hstack([linear, twist[:, 3:]])
    for i, c in enumerate(plan.channels):
        if kind := kind_of(c):
            out[:, i] = kind.change(Seen(plan, out[:, :6], plan.position + arm), None)
        elif c.joint == name and c.side == "load":
            out[:, i] = more
    return out


def records_of(terms: Sequence[AppliedEffect]) -> list[str]:
    """Columns of an experiment that give numbers of these effects."""
    return sorted({p.recorded for t in terms for p in get(t.kind).parameters if p.recorded})


def at_records(plan: Experiment, terms: Terms, solve: Solve, columns: Sequence[str] | None = None) -> Floats:
    """(n, c) motions with every row at its own record: its change against the file's reference, of temperatures, or the first row."""
    left = records_of(terms) if columns is None else columns
    if not left:
        return solve(plan, terms)
    column, *others = left
    values = getattr(plan, column)
    if values is None:
        raise StiffmapError(f"{plan.name}: missing column '{column}'")
    reference = plan.reference_temperature if column == "temperature" else None
    change = values - (float(values[0]) if reference is None else reference)
    low, high = float(change.min()), float(change.max())
    nodes = np.array([low, (low + high) / 2, high]) if high - low > 1e-9 else np.array([low])
    out = np.zeros(())
    for node in nodes:
        rest = nodes[nodes != node]
        weight = np.prod((change[:, None] - rest) / (node - rest), axis=1)  # Lagrange's
        recorded = tuple(_recorded(t, column, float(node)) for t in terms)
        out = out + weight[:, None] * at_records(plan, recorded, solve, others)
    return out


def _recorded(term: AppliedEffect, column: str, value: float) -> AppliedEffect:
    mine = {p.name: value for p in get(term.kind).parameters if p.recorded == column}
    return replace(term, parameters=tuple({**dict(term.parameters), **mine}.items())) if mine else term

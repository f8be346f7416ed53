"""Readings that depend on the rows before: drives with friction, play and stiffening (effect `hysteresis`).

Theory L5. The spring's force s follows the drive's force F as a play operator does, |F - s| <= level; deflection is a
function of s. That is Coulomb friction beside a spring, exactly, for any monotone law; many elements with levels of their
own are a Prandtl-Ishlinskii model, which obeys Masing's rule. The drive's extra deflection moves the tool by the rigid
machine's Jacobian.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.description import AppliedEffect, Joint
from stiffmap.description.tree import all_elements
from stiffmap.effects.check import values_at
from stiffmap.effects.registry import get
from stiffmap.errors import StiffmapError
from stiffmap.experiment.channels import DISTANCE
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.poses.point_kinematics import point_positions
from stiffmap.experiment.prediction.metrology_loop import targets
from stiffmap.experiment.prediction.unloaded_state import drive_jacobian
from stiffmap.machine import Machine
from stiffmap.options import SolveOptions

KINDS = ("hysteresis",)
ELEMENTS = 16
"""Elements that stand for a spread of levels."""


def spring_force(force: Floats, level: ArrayLike, breakaway: float = 1.0) -> Floats:
    """(n, ...) force s that the spring feels while the drive's `force` (n,) runs, from rest at s = 0, with
    elements of these levels (...)."""
    levels = np.asarray(level, dtype=float)
    s, sliding = np.zeros(levels.shape), np.zeros(levels.shape)
    out = np.empty((len(force), *levels.shape))
    for i, f in enumerate(force):
        gap = f - s
        reach = np.where(sliding * gap > 0, levels, levels * breakaway)
        moves = np.abs(gap) > reach
        rests = ~moves & (sliding * gap < levels * (1 - 1e-12))
        sliding = np.where(moves, np.sign(gap), np.where(rests, 0.0, sliding))
        s = np.where(moves, f - sliding * levels, s)
        out[i] = s
    return out


def deflection(force: Floats, compliance: float, values: Mapping[str, float]) -> Floats:
    """(n,) deflection of a drive while `force` (n,) runs, theory L5."""
    level, spread = values["level"], values["spread"]
    levels = level * (1 + spread * np.linspace(-1, 1, ELEMENTS)) if spread > 0 else np.array([level])
    ratio, knee = values["ratio"], values["knee"]
    s = spring_force(force, levels, values["breakaway"])
    bent = ratio * s + (1 - ratio) * knee * np.tanh(s / knee)
    return np.asarray((compliance * bent + values["half_width"] * np.tanh(s / values["seat"])).mean(axis=1))


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
    """(n, c) m, rad that the terms of `KINDS` add to the motions of the machine under a plan.

    Raises StiffmapError without an order of time, and for distances.
    """
    if plan.order is None:
        raise StiffmapError(f"{plan.name}: hysteresis needs the column 'order': rows in order of time")
    if DISTANCE in plan.extra:
        raise StiffmapError(f"{plan.name}: hysteresis cannot be predicted for distances between two poses")
    machine = drives.machine
    out = np.zeros((len(plan), len(plan.channels)))
    for term in terms:
        values = values_at(get(term.kind), machine.description.declared or machine.description, term)
        for name in _drives(machine, term):
            k = machine.actuators.index(name)
            more = _extra(machine, plan, name, -drives.effort[:, k], values)
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
    machine: Machine, plan: Experiment, name: str, force: Floats, values: Mapping[str, float]
) -> Floats:
    """(n,) deflection beyond that of the machine's own spring, set-up by set-up in order of time."""
    joint = dict(all_elements(machine.description))[name]
    assert isinstance(joint, Joint)
    assert joint.law is not None
    compliance = 1.0 / joint.law.stiffness
    assert plan.order is not None
    label = np.unique(plan.setup or ("",) * len(plan), return_inverse=True)[1].reshape(-1)
    out = np.empty(len(plan))
    for setup in np.unique(label):
        here = np.flatnonzero(label == setup)
        run = here[np.argsort(plan.order[here], kind="stable")]
        out[run] = deflection(force[run], compliance, values) - compliance * force[run]
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
        if c.name == "hh":
            out[:, i] = linear @ np.array(plan.normal)
        elif c.joint == name and c.side == "load":
            out[:, i] = more
    return out

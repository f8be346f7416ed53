"""Motions of the reading point at every row of a plan."""

from __future__ import annotations

import numpy as np

from stiffmap.description.strain import rests_at_command
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.kinematics import inverse_kinematics
from stiffmap.machine import Machine
from stiffmap.status import Status


def motions(machine: Machine, plan: Experiment, threads: int | None = None) -> tuple[Floats, int]:
    """(n, 6) m, rad of every row, and how many equilibria were solved.

    Deflection: the loaded minus the unloaded equilibrium of the same commanded pose.
    """
    if not plan.wrench.any() and not _moves_unloaded(machine, plan):
        return _at_command(machine, plan), 0
    motion, count = _unique(machine, plan, plan.wrench, threads)
    if plan.quantity == "deflection" and _moves_unloaded(machine, plan):
        rest, more = _unique(machine, plan, np.zeros_like(plan.wrench), threads)
        return motion - rest, count + more
    return motion, count


def _at_command(machine: Machine, plan: Experiment) -> Floats:
    """(n, 6) zero where the pose can be reached, else NaN."""
    status = inverse_kinematics(machine, plan.position, plan.rotation).status
    return np.where((status == Status.CONVERGED)[:, None], np.zeros((len(plan), 6)), np.nan)


def _moves_unloaded(machine: Machine, plan: Experiment) -> bool:
    """Without load only errors, preload or weight move a machine from its command."""
    d = machine.description
    return bool(plan.gravity or d.gravity) or not rests_at_command(d)


def _unique(machine: Machine, plan: Experiment, wrench: Floats, threads: int | None) -> tuple[Floats, int]:
    key = np.hstack([plan.groups[:, None], wrench])
    _, first, back = np.unique(key, axis=0, return_index=True, return_inverse=True)
    solution = machine.solve(
        plan.position[first],
        wrench[first],
        rotation=None if plan.rotation is None else plan.rotation[first],
        point=plan.load_point,
        read_points=[plan.point],
        gravity=plan.gravity,
        stiffness=False,
        threads=threads,
    )
    out = np.where(solution.ok[:, None], solution.readings[:, 1], np.nan)
    return out[back.reshape(-1)], len(first)

"""Rows to choose from: within reach and limits, and joined to those that have been measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.virtual.plans import load_set, plan_of_poses, random_poses
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Flag

OFF_LIMITS = Flag.DRIVE_RANGE | Flag.JOINT_LIMIT


def candidate_rows(
    machine: Machine,
    quantity: str,
    poses: int,
    force: float,
    axes: Sequence[str],
    noise: float | None,
    seed: int,
) -> Experiment:
    """Random poses of the workspace, for deflections under loads along the axes."""
    where = random_poses(machine, poses, seed)
    return plan_of_poses(machine, quantity, where, load_set("axes", [force]), axes=axes, noise=noise)


def in_limits(machine: Machine, plan: Experiment) -> Experiment:
    """Rows whose pose is within reach and limits."""
    if plan.command is not None:
        return plan
    at = inverse_kinematics(machine, plan.position, plan.rotation)
    good = np.isfinite(at.position).all(axis=1) & ((at.flags & OFF_LIMITS) == 0)
    if not good.any():
        raise StiffmapError(f"{machine.name}: no candidate pose is within the drives' range")
    return plan.rows(np.asarray(good))


def joined(a: Experiment, b: Experiment) -> Experiment:
    """Rows of one after the other; fields that only one has are left out."""
    whole = [len(a), len(b)]

    def both(x: object, y: object) -> object:
        if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
            return np.concatenate([x, y])
        if isinstance(x, tuple) and isinstance(y, tuple) and [len(x), len(y)] == whole:
            return x + y
        return x

    fields = (
        "position",
        "wrench",
        "reading",
        "sigma",
        "rotation",
        "approach",
        "branch",
        "setup",
        "temperature",
    )
    joined: dict[str, Any] = {name: both(getattr(a, name), getattr(b, name)) for name in fields}
    n = sum(whole)
    return replace(
        a,
        **joined,
        ids=tuple(str(i + 1) for i in range(n)),
        order=np.arange(1.0, n + 1),
        repeat=None,
    )

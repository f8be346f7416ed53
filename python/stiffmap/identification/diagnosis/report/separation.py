"""The measurement that distinguishes two explanations best: where, which load, which axis, how many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.experiment.experiment import AXES, Experiment, Floats
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.experiment.readings import kind_of
from stiffmap.experiment.virtual.plans import plan_of_poses, with_joints
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine

WANTED = 5.0
"""Standard deviations between the two predictions that the measurement must reach."""
KEPT = ("reference_temperature", "point", "load_point", "gravity", "loop")
"""Of an experiment, what its trial has too."""


@dataclass(frozen=True)
class Separation:
    """One measurement, SI, base axes."""

    position: tuple[float, float, float]
    force: tuple[float, float, float]
    axis: str
    difference: float
    """Between the two predictions, m."""
    readings: int | None
    """How many give five standard deviations; None: more than 10 000, not worth trying."""


def separation(
    predictor: Predictor,
    floor: Floats,
    one: Sequence[AppliedEffect],
    other: Sequence[AppliedEffect],
    seed: int,
) -> Separation:
    """Best reading, of those that the machine can reach, of a trial plan: workspace corners, centre and random poses, six force
    directions; `floor` (c,) is the noise of each channel."""
    e = predictor.experiment
    plan = _trial(e, predictor.machine, seed)
    at = Predictor(predictor.machine, plan, threads=predictor.threads)
    trial = at.experiment
    gap = at(one) - at(other)
    floor = floor[[kind_of(c) is None for c in e.channels]]
    sigma = np.where(np.isfinite(floor), floor, np.inf)
    clear = np.nan_to_num(np.abs(gap) / sigma)
    row, axis = np.unravel_index(int(np.argmax(clear)), clear.shape)
    top = float(clear[row, axis])
    number = int(np.ceil((WANTED / top) ** 2)) if top > WANTED / 100 else None
    x, y, z = (float(v) for v in trial.position[row])
    fx, fy, fz = (float(v) + 0.0 for v in trial.wrench[row, :3])  # no -0
    name = trial.channels[int(axis)].name
    return Separation((x, y, z), (fx, fy, fz), name, float(gap[row, axis]), number)


def _trial(e: Experiment, machine: Machine, seed: int) -> Experiment:
    low, high = e.position.min(axis=0), e.position.max(axis=0)
    if machine.description.workspace is not None:
        low, high = np.array(machine.description.workspace)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    middle = np.vstack([corners * 0.98 + 0.02 * (low + high) / 2, (low + high) / 2])
    poses = np.vstack([middle, random_numbers(seed).uniform(low, high, (15, 3))])
    loads = np.zeros((1, 6))
    if e.quantity == "deflection":
        size = float(np.abs(e.wrench[:, :3]).max()) or 100.0
        loads = np.hstack(
            [np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 3**-0.5)]) * size, np.zeros((7, 3))]
        )
        loads = np.vstack([loads, 0.25 * loads])
    joints = [c for c in e.extra if c.joint]
    plan = plan_of_poses(machine, e.quantity, poses, loads, axes=[a for a in e.axes if a in AXES])
    plan, n = with_joints(plan, joints, [1.0] * len(joints)), len(poses) * len(loads)
    return replace(
        plan,
        order=None if e.order is None else np.linspace(e.order.min(), e.order.max(), n),
        temperature=None if e.temperature is None else np.full(n, float(e.temperature.max())),
        **{name: getattr(e, name) for name in KEPT},
    )

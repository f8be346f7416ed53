"""The measurement that distinguishes two explanations best: where, which load, which axis, how many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.experiment.readings import kind_of
from stiffmap.model.description import AppliedEffect, MachineDescription

WANTED = 5.0
"""Standard deviations between the two predictions that the measurement must reach."""


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
    plan = _trial(e, predictor.machine.description, seed)
    at = Predictor(predictor.machine, plan, threads=predictor.threads)
    trial = at.experiment
    gap = at(one) - at(other)
    floor = floor[_kept(e)]
    sigma = np.where(np.isfinite(floor), floor, np.inf)
    clear = np.nan_to_num(np.abs(gap) / sigma)
    row, axis = np.unravel_index(int(np.argmax(clear)), clear.shape)
    top = float(clear[row, axis])
    number = int(np.ceil((WANTED / top) ** 2)) if top > WANTED / 100 else None
    x, y, z = (float(v) for v in trial.position[row])
    fx, fy, fz = (float(v) + 0.0 for v in trial.wrench[row, :3])  # no -0
    name = trial.channels[int(axis)].name
    return Separation((x, y, z), (fx, fy, fz), name, float(gap[row, axis]), number)


def _kept(e: Experiment) -> list[int]:
    """Axes of a pose and joints."""
    return [i for i, c in enumerate(e.channels) if kind_of(c) is None]


def _trial(e: Experiment, description: MachineDescription, seed: int) -> Experiment:
    low, high = e.position.min(axis=0), e.position.max(axis=0)
    if description.workspace is not None:
        low, high = np.array(description.workspace)
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
    n = len(poses) * len(loads)
    position = np.repeat(poses, len(loads), axis=0)
    read = np.where(e.axis_read, 0.0, np.nan)[_kept(e)]
    return Experiment(
        name="trial",
        machine=e.machine,
        quantity=e.quantity,
        ids=tuple(map(str, range(n))),
        position=position,
        wrench=np.tile(loads, (len(poses), 1)),
        reading=np.tile(read, (n, 1)),
        sigma=np.full((n, len(read)), np.nan),
        extra=tuple(c for c in e.extra if c.joint),
        order=None if e.order is None else np.linspace(e.order.min(), e.order.max(), n),
        temperature=None if e.temperature is None else np.full(n, float(e.temperature.max())),
        reference_temperature=e.reference_temperature,
        point=e.point,
        load_point=e.load_point,
        gravity=e.gravity,
        loop=e.loop,
    )

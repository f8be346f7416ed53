"""Virtual experiments: a plan, a machine with effects, and noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.description import AppliedEffect
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.predict import predict
from stiffmap.machine import Machine


def simulate(
    machine: Machine,
    plan: Experiment,
    effects: Sequence[AppliedEffect] = (),
    *,
    seed: int = 0,
    outliers: float = 0.0,
) -> Experiment:
    """The plan's readings on a machine that has `effects`, with noise of the declared size.

    outliers
        Share of rows that are off by 5 to 20 standard deviations.

    Raises StiffmapError where no noise is declared or the machine cannot be solved.
    """
    exact = predict(machine, plan, tuple(effects))
    read = plan.axis_read
    if np.isnan(plan.sigma[plan.read]).any():
        raise StiffmapError(f"{plan.name}: a virtual experiment needs a declared noise for every axis read")
    if np.isnan(exact[plan.read]).any():
        raise StiffmapError(f"{plan.name}: the machine has no equilibrium at some rows of the plan")
    rng = np.random.default_rng(seed)
    reading = exact + np.nan_to_num(plan.sigma) * rng.standard_normal(exact.shape)
    reading = reading + _zeros(plan, rng)
    wild = rng.random(len(plan)) < outliers
    reading[wild] += (
        rng.choice([-1, 1], (wild.sum(), 6)) * rng.uniform(5, 20, (wild.sum(), 1)) * plan.sigma[wild]
    )
    return replace(plan, reading=np.where(plan.read & read, reading, np.nan))


def _zeros(plan: Experiment, rng: np.random.Generator) -> Floats:
    zeros = rng.standard_normal((int(plan.groups.max()) + 1, 6)) * plan.zero_sigma
    return np.asarray(zeros[plan.groups])


def random_plan(
    machine: Machine,
    quantity: str = "deflection",
    *,
    poses: int = 30,
    loads: int = 9,
    repeats: int = 2,
    force: float = 400.0,
    noise: float | None = None,
    seed: int = 0,
) -> Experiment:
    """Poses at random in the workspace; for deflections forces of three sizes along ± x, y, z.

    force
        Largest force, N; the others are 5/8 and 1/4 of it.
    noise
        One standard deviation of a reading, m; None: 3 µm for deflections, 8 µm for positions.
    """
    if quantity not in ("deflection", "position"):
        raise StiffmapError(f"quantity: expected deflection or position, got {quantity!r}")
    rng = np.random.default_rng(seed)
    low, high = machine.workspace
    where = np.round(rng.uniform(low, high, (poses, 3)), 4)
    sizes = np.array([0.25, 0.625, 1.0]) * force
    every = np.vstack([s * size * np.eye(3)[a] for a in range(3) for s in (-1, 1) for size in sizes])
    number = loads if quantity == "deflection" else 1
    chosen = [every[rng.permutation(len(every))[: min(number, len(every))]] for _ in range(poses)]
    forces = np.vstack(chosen) if quantity == "deflection" else np.zeros((poses, 3))
    position = np.repeat(where, len(forces) // poses, axis=0)
    n = len(position) * repeats
    sigma = np.full((n, 6), np.nan)
    sigma[:, :3] = noise or (3e-6 if quantity == "deflection" else 8e-6)
    return Experiment(
        name="plan",
        machine=machine.name,
        quantity=quantity,
        ids=tuple(str(i + 1) for i in range(n)),
        position=np.repeat(position, repeats, axis=0),
        wrench=np.repeat(np.hstack([forces, np.zeros_like(forces)]), repeats, axis=0),
        reading=np.where(np.isfinite(sigma), 0.0, np.nan),
        sigma=sigma,
        repeat=np.tile(np.arange(repeats) + 1, len(position)),
        order=np.arange(1, n + 1, dtype=float),
    )

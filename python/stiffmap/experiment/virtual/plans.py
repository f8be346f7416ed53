"""Plans of virtual experiments: where, under which loads, how often, in which order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import (
    instance_of,
    one_of,
    random_numbers,
    real_array,
    real_number,
    trailing,
    whole_number,
    wrench_array,
)
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.channels import AXES, AXIS_CHANNELS, Channel
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.readings.library.distance_and_height import DISTANCE
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine, as_machine, takes_machine
from stiffmap.workspace.maps.inputs import magnitude

MICRO = {"deflection": 3e-6, "position": 8e-6}
"""m: default noise of a reading."""
MARGIN = 0.02
"""Share of the workspace that a grid keeps off its border."""


def random_poses(machine: Machine, number: int, seed: int) -> Floats:
    """(number, 3) m, evenly distributed over the workspace box."""
    low, high = machine.workspace
    whole_number(number, "poses", 1)
    return np.asarray(np.round(random_numbers(seed).uniform(low, high, (number, 3)), 4))


def grid_poses(machine: Machine, counts: Sequence[int]) -> Floats:
    """(counts product, 3) m, a box grid just inside the workspace; one layer is in the middle."""
    low, high = machine.workspace
    axes = []
    for a, n in enumerate(counts):
        edge = MARGIN * (high[a] - low[a])
        middle = [(low[a] + high[a]) / 2]
        axes.append(np.linspace(low[a] + edge, high[a] - edge, n) if n > 1 else np.array(middle))
    return np.round(np.array(np.meshgrid(*axes, indexing="ij")).reshape(3, -1).T, 6)


def load_set(name: str, sizes: Sequence[float]) -> Floats:
    """(m, 6) N of a pose. ``axes``: ± x, y, z in every size. ``full``: these, the sums of pairs in the
    largest size, and no load, so that every model-free check can be made."""
    sizes = real_array(sizes, "force", "sizes (N)").reshape(-1).tolist()
    single = [s * size * np.eye(3)[a] for a in range(3) for s in (-1, 1) for size in sizes]
    if name == "full":
        top = max(sizes)
        pairs = [top * (np.eye(3)[a] + np.eye(3)[b]) for a, b in ((0, 1), (0, 2), (1, 2))]
        single = [*single, *pairs, np.zeros(3)]
    elif name != "axes":
        raise StiffmapError(f"loads: expected axes, full or a number, got {name!r}")
    return np.hstack([np.array(single), np.zeros((len(single), 3))])


def plan_of_poses(
    machine: Machine,
    quantity: str,
    poses: Floats,
    loads: Floats | Sequence[Floats],
    *,
    repeats: int = 1,
    axes: Sequence[str] = AXES[:3],
    noise: float | None = None,
    angle_noise: float = 1e-5,
) -> Experiment:
    """Each pose (p, 3) under each load (m, 6), or under its own ones of a list of p such arrays.

    noise, angle_noise
        One standard deviation of a reading, m and rad; None: 3 µm for deflections, 8 µm for positions.
    """
    one_of(quantity, MICRO, "quantity")
    for axis in instance_of(axes, Sequence, "axes", "names of axes"):
        one_of(axis, AXES, "axes")
    poses = trailing(poses, (3,), "poses", "positions (m)").reshape(-1, 3)
    own = [np.zeros((1, 6))] * len(poses) if quantity == "position" else _each(loads, len(poses))
    position = np.repeat(poses, [len(w) for w in own], axis=0)
    wrench = np.vstack(own)
    n = len(position) * whole_number(repeats, "repeats", 1)
    given = None if noise is None else magnitude(noise, "noise", "m")
    turn = real_number(angle_noise, "angle_noise")
    plan = Experiment(
        name="plan",
        machine=as_machine(machine).name,
        quantity=quantity,
        ids=("",) * n,
        position=np.repeat(position, repeats, axis=0),
        wrench=np.repeat(wrench, repeats, axis=0),
        repeat=np.tile(np.arange(repeats) + 1, len(position)),
        **unread(n, quantity, axes, given, turn),
    )
    return numbered_anew(plan)


def unread(
    rows: int, quantity: str, axes: Sequence[str], noise: float | None, angle_noise: float
) -> dict[str, Any]:
    """Readings (rows, 6) that are yet to be made of some axes, and their standard deviations, m and rad."""
    size = np.where([c.unit == "m" for c in AXIS_CHANNELS], noise or MICRO[quantity], angle_noise)
    sigma = np.tile(np.where([a in axes for a in AXES], size, np.nan), (rows, 1))
    return {"reading": np.where(np.isfinite(sigma), 0.0, np.nan), "sigma": sigma}


def numbered_anew(plan: Experiment) -> Experiment:
    """The plan with the names and the order of its rows from 1 on."""
    number = np.arange(1, len(plan.position) + 1)
    return replace(plan, ids=tuple(map(str, number)), order=number.astype(float))


def _each(loads: Floats | Sequence[Floats], number: int) -> list[Floats]:
    if isinstance(loads, np.ndarray):
        loads = [loads] * number
    given = instance_of(loads, Sequence, "loads", "wrenches")
    each = [wrench_array(w, "loads").reshape(-1, 6) for w in given]
    if len(each) != number:
        raise StiffmapError(f"loads: expected one array for each of {number} poses, got {len(each)}")
    return each


@takes_machine
@checked
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

    Raises StiffmapError for bad input.
    """
    rng = random_numbers(seed)
    low, high = machine.workspace
    where = np.round(rng.uniform(low, high, (whole_number(poses, "poses", 1), 3)), 4)
    every = load_set("axes", np.multiply([0.25, 0.625, 1.0], magnitude(force, "force", "N")).tolist())
    own = [every[rng.permutation(len(every))[: whole_number(loads, "loads", 1)]] for _ in range(poses)]
    return plan_of_poses(machine, quantity, where, own, repeats=repeats, noise=noise)


def with_joints(plan: Experiment, channels: Sequence[Channel], sigma: Sequence[float]) -> Experiment:
    """The plan with encoders read in every row, and their standard deviations (m or rad)."""
    extra = np.tile(np.asarray(sigma, dtype=float), (len(plan), 1))
    return replace(
        plan,
        extra=(*plan.extra, *channels),
        reading=np.hstack([plan.reading, np.zeros_like(extra)]),
        sigma=np.hstack([plan.sigma, extra]),
    )


def with_branches(plan: Experiment) -> Experiment:
    """Every row on both branches, loading first."""
    twice = plan.rows(np.repeat(np.arange(len(plan)), 2).astype(np.intp))
    return numbered_anew(replace(twice, branch=("loading", "unloading") * len(plan)))


def shuffled(plan: Experiment, seed: int) -> Experiment:
    """The plan with its poses visited in random order: what drifts is then no trend in space."""
    rank = random_numbers(seed).permutation(int(plan.groups.max()) + 1)
    index = np.argsort(rank[plan.groups], kind="stable")
    return numbered_anew(plan.rows(index.astype(np.intp)))


def with_temperature(plan: Experiment, first: float, last: float) -> Experiment:
    """A temperature (°C) that rises evenly from the first row to the last; counted from `first`."""
    ramp = np.round(np.linspace(first, last, len(plan)), 3)
    return replace(plan, temperature=ramp, reference_temperature=first)


def with_setups(plan: Experiment, number: int) -> Experiment:
    """Poses dealt to set-ups, one after the other."""
    share = plan.groups * number // (int(plan.groups.max()) + 1)
    return replace(plan, setup=tuple(f"S{i + 1}" for i in share))


def with_approach(plan: Experiment, seed: int) -> Experiment:
    """Each pose reached along x, y or z, forwards or backwards."""
    rng = random_numbers(seed)
    way = np.vstack([np.eye(3), -np.eye(3)])[rng.integers(0, 6, int(plan.groups.max()) + 1)]
    return replace(plan, approach=way[plan.groups])


def with_distances(plan: Experiment, sigma: float) -> Experiment:
    """Distances between the point at each pose and at the next one instead of the poses themselves."""
    first = np.unique(plan.groups, return_index=True)[1]
    there = np.roll(plan.position[first], -1, axis=0)[plan.groups]
    unread = np.full((len(plan), len(AXES)), np.nan)
    column = np.zeros((len(plan), 1))
    kept = plan.reading[:, len(AXES) :], plan.sigma[:, len(AXES) :]
    return replace(
        plan,
        extra=(DISTANCE.channel, *plan.extra),
        other=there,
        other_rotation=plan.rotation,
        reading=np.hstack([unread, column, kept[0]]),
        sigma=np.hstack([unread, column + sigma, kept[1]]),
    )


def with_command(plan: Experiment, machine: Machine) -> Experiment:
    """The plan's poses as commanded actuator coordinates."""
    found = inverse_kinematics(machine, plan.position, plan.rotation)
    names = machine.compiled.names
    channels = tuple(
        Channel(f"c_{a.replace('.', '_')}", "m" if names.is_prismatic(a) else "rad", a)
        for a in machine.actuators
    )
    return replace(plan, command=found.actuators, command_of=channels)

"""Options of ``stiffmap simulate`` to a plan."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import load_experiment
from stiffmap.experiment.channels import AXES, SIDES, Channel
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.files.plan_file import load_plan
from stiffmap.experiment.virtual import plans as make
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import numbers

GRID = re.compile(r"^grid:(\d+)x(\d+)x(\d+)$")
WORDS = {
    "frame": ("known", "offset_unknown", "unknown"),
    "tool": ("known", "offset_unknown"),
    "unloaded": ("centre", "approach", "unknown"),
}


def sizes(text: str) -> list[float]:
    """Sizes of forces, N."""
    found = numbers(text, "forces").tolist()
    if min(found) <= 0:
        raise StiffmapError(
            f"--forces: expected sizes above zero (signs are part of the loads), got '{text}'"
        )
    return [float(v) for v in found]


def axes(text: str) -> tuple[str, ...]:
    """Axes that are read."""
    if text == "none":
        return ()
    wanted = tuple(a.strip() for a in text.split(",") if a.strip())
    wrong = [a for a in wanted if a not in AXES]
    if wrong or not wanted:
        raise StiffmapError(f"--read: expected axes of {', '.join(AXES)}, got '{text}'")
    return wanted


def layout(
    machine: Machine,
    plan: str,
    quantity: str,
    poses: int,
    loads: str,
    forces: Sequence[float],
    repeats: int,
    read: Sequence[str],
    noise: float | None,
    angle_noise: float,
    seed: int,
) -> Experiment:
    """The plan that ``--plan`` and the other options describe."""
    if quantity not in make.MICRO:
        raise StiffmapError(f"--quantity: expected deflection or position, got {quantity!r}")
    if noise is not None and noise <= 0:
        raise StiffmapError(f"--noise: expected a standard deviation above zero, got {1e3 * noise:g} mm")
    for name, value in (("poses", poses), ("repeats", repeats)):
        if value < 1:
            raise StiffmapError(f"--{name}: expected at least 1, got {value}")
    path = Path(plan)
    if path.suffix == ".csv":
        return load_plan(path, machine, quantity, axes=read, noise=noise, angle_noise=angle_noise)
    if path.exists():
        return _repeated(load_experiment(path), noise)
    where = _poses(machine, plan, poses, seed)
    own = _loads(loads, forces, len(where), seed)
    return make.plan_of_poses(
        machine, quantity, where, own, repeats=repeats, axes=read, noise=noise, angle_noise=angle_noise
    )


def _repeated(plan: Experiment, noise: float | None) -> Experiment:
    """An experiment's plan; another noise of its lengths where one is given."""
    if noise is None:
        return plan
    length = np.array([c.unit == "m" for c in plan.channels])
    return replace(plan, sigma=np.where(length & plan.read, noise, plan.sigma))


def _poses(machine: Machine, plan: str, poses: int, seed: int) -> Floats:
    if plan == "random":
        return make.random_poses(machine, poses, seed)
    found = GRID.match(plan)
    if not found or "0" in found.groups():
        raise StiffmapError(
            f"--plan: expected random, grid:NXxNYxNZ, a CSV file or an experiment folder, got '{plan}'"
        )
    return make.grid_poses(machine, [int(n) for n in found.groups()])


def _loads(text: str, forces: Sequence[float], poses: int, seed: int) -> list[Floats]:
    if not text.isdigit():
        return [make.load_set(text, forces)] * poses
    every, number = make.load_set("axes", forces), int(text)
    if not 1 <= number <= len(every):
        raise StiffmapError(f"--loads: expected 1 to {len(every)} of these forces, got {number}")
    rng = random_numbers(seed, 1)
    return [every[rng.permutation(len(every))[:number]] for _ in range(poses)]


def channels(
    plan: Experiment, machine: Machine, joints: Sequence[str], distances: bool, noise: float | None
) -> Experiment:
    """The plan with distances, and with encoders; their noise is that of the lengths, or 10 µrad."""
    length = noise or make.MICRO[plan.quantity]
    if distances:
        if plan.quantity != "position":
            raise StiffmapError("--distances: a distance between two poses needs --quantity position")
        plan = make.with_distances(plan, length)
    found = [_encoder(machine, text) for text in joints]
    plan = make.with_joints(plan, found, [length if c.unit == "m" else 1e-5 for c in found])
    if not plan.read.any():
        raise StiffmapError("--read none: nothing is read; add --joint or --distances")
    return plan


def _encoder(machine: Machine, text: str) -> Channel:
    names = machine.compiled.names
    name, _, side = text.partition(":")
    if name not in names.joints or (side or "load") not in SIDES:
        there = ", ".join(names.joints)
        raise StiffmapError(f"--joint: expected NAME or NAME:motor with NAME of {there}, got '{text}'")
    column = f"q_{name.replace('.', '_')}{'_motor' if side == 'motor' else ''}"
    return Channel(column, "m" if names.is_prismatic(name) else "rad", name, side or "load")


def history(
    plan: Experiment,
    branches: bool,
    shuffle: bool,
    temperature: str | None,
    setups: int,
    approach: bool,
    seed: int,
) -> Experiment:
    """The plan with what happens to it in time."""
    plan = make.with_branches(plan) if branches else plan
    plan = make.with_approach(plan, seed) if approach else plan
    plan = make.shuffled(plan, seed) if shuffle else plan
    plan = make.with_setups(plan, setups) if setups > 1 else plan
    if temperature is None:
        return plan
    first, last = numbers(temperature, "temperature", 2).tolist()
    return make.with_temperature(plan, first, last)


def unknowns(
    plan: Experiment, frame: str, tool: str, unloaded: str, zero_noise: float, gravity: str | None
) -> Experiment:
    """The plan with what it does not know; words that differ from the default replace the plan's own."""
    given = {"frame": frame, "tool": tool, "unloaded": unloaded}
    for name, word in given.items():
        if word not in WORDS[name]:
            raise StiffmapError(f"--{name}: expected {', '.join(WORDS[name])}, got '{word}'")
    if unloaded == "approach" and plan.approach is None:
        raise StiffmapError("--unloaded approach needs --approach, or a plan with the columns approach_x …")
    if zero_noise:
        plan = replace(plan, zero_sigma=np.array([zero_noise] * 3 + [0.0] * 3))
    if gravity is not None:
        x, y, z = (float(v) for v in numbers(gravity, "gravity", 3))
        plan = replace(plan, gravity=(x, y, z))
    return replace(plan, **{k: w for k, w in given.items() if w != WORDS[k][0]})  # type: ignore[arg-type]

"""Random machines of all families and classes under many loads at many commands of their drives, for `many`."""

from __future__ import annotations

from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.model.description import MachineDescription

from .classes import CLASSES, Classes
from .generate import Generator
from .statics import coordinates
from .verify import Question

FAMILIES = ("random_legs", "hexapod", "heavy_starts", "arm_on_a_rail", "unlike_delta", "four_legs")
KINDS = (*FAMILIES, *(n for n in CLASSES if n not in ("few", "hung")))
TIED = ("random_legs", "heavy_starts", "over-actuated", "gantry", "cables", "four_legs", "springs outside")
"""Kinds whose drives cannot each go their own way: they stay at one command."""
STROKE = 0.03  # m, rad
COMMANDS = 40  # of a machine: closing them costs more than loads do
AWAY = 300  # poses of a machine away from home, where each is closed


def description(kind: str, seed: int) -> tuple[MachineDescription, float, dict[str, float] | None]:
    """A machine, the size of its loads (N), and its command by drives where it has one."""
    if kind in FAMILIES:
        return getattr(Generator(seed), kind)(), 300.0, None
    task = Classes(seed).task(kind)
    return task.description, max(1e-3, float(np.linalg.norm(task.loads.force))), task.drives


def crowd(kind: str, seed: int, count: int) -> Question:
    """A machine and at most `count` loads, from a ten-thousandth of its own to thrice that; at home, away from it for
    every fourth seed."""
    d, size, drives = description(kind, seed)
    spread = 0.0 if kind in TIED or seed % 4 else STROKE
    count = min(count, AWAY) if spread and kind != "arm of axes" else count
    machine, rng = sm.Machine(d), np.random.default_rng((seed, 3))
    force = rng.normal(size=(count, 3))
    force *= (size * 10 ** rng.uniform(-4, 0.5, count) / np.linalg.norm(force, axis=1))[:, None]
    load_type = str(rng.choice(["dead", "dead", "dead", "follower", "semitangential"]))
    turning = load_type == "dead" and rng.random() < 0.5
    moment = 0.0 if turning else 0.05 * np.linalg.norm(force, axis=1)[:, None] * rng.normal(size=(count, 3))
    method = "reference" if rng.random() < 0.01 else "fast"
    if method == "reference":
        count = min(count, 20)
    wrench = np.hstack([force, moment * np.ones((len(force), 3))])[:count]
    gravity = [0.0, 0.0, -9.81] if rng.random() < 0.5 and kind != "leaves" else [0.0, 0.0, 0.0]
    load: dict[str, Any] = {"wrench": wrench, "load_type": load_type, "gravity": gravity, "method": method}
    names, extent = machine.compiled.names, max(0.5, float(np.abs(d.home.p).max()))
    if not names.actuators:
        at = np.tile(np.array(d.home.p), (count, 1))
        still = sm.inverse_kinematics(machine, at).coordinates
        return Question(machine, load, at, coordinates(names.coordinates, still), extent)
    home = sm.inverse_kinematics(machine, d.home.p, d.home.r).actuators
    middle = home if drives is None else np.array([drives[named(n, drives)] for n in names.actuators])
    commands = middle + spread * rng.uniform(-1, 1, (min(COMMANDS, count), len(middle)))
    closed = sm.forward_kinematics(machine, commands, threads=1)
    of = rng.integers(len(commands), size=count)
    before = coordinates(names.coordinates, closed.coordinates[of])
    if kind == "arm of axes":  # some have more axes than a pose has freedoms, some fewer
        return Question(machine, load, commands[of], before, extent, joints=True)
    load["rotation"] = closed.rotation[of]
    return Question(machine, load, closed.position[of], before, extent)


def named(name: str, drives: dict[str, float]) -> str:
    return name if name in drives else name.removeprefix("platform.")

"""The measures that exist: those of the files in `stiffmap.workspace.performance.kinds`, found by being there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.python_file import modules_of
from stiffmap.common.tasks import workers
from stiffmap.solve.machine import Machine
from stiffmap.workspace.maps.inputs import box_nodes
from stiffmap.workspace.performance import kinds
from stiffmap.workspace.performance.motion.closing import (
    CHUNK,
    DriveKinematics,
    drive_kinematics,
    kernel_starts,
)
from stiffmap.workspace.performance.motion.motion_files import Motion
from stiffmap.workspace.performance.motion.velocity import VelocityTransmission, transmission_of


@dataclass(eq=False)
class Case:
    """What measures are asked about: a machine, a box of poses, a force. Kinematics are shared."""

    machine: Machine
    low: Floats
    high: Floats
    force: float = 100.0
    plane: str = "xy"
    transmission: tuple[float, float] = (0.5, 2.0)
    proportions: tuple[float, float, float] = (1.0, 1.0, 1.0)
    nodes: int = 51
    coarse: int = 7
    gap: float = 1e-4
    quick: bool = False
    """Searching among designs: nodes only where a proof or a search would follow."""
    length: float | None = None
    gravity: Floats | None = None
    rotation: Floats | None = None
    threads: int | None = None
    toolpath: Motion | None = None
    """The task's own path and force, for measures along it."""
    clearance: float | None = None
    """m, least distance between members of different legs in the workspace; None: not asked for."""
    deflection: float | None = None
    """m, largest deflection under `force` in `plane` in the workspace; None: not asked for."""
    scheduler: object = None
    """`distributed.Client` whose workers close `positions` and prove the largest box; None: here."""

    @property
    def limits(self) -> dict[str, Any]:
        """The limits that a pose of the workspace keeps in addition to ranges of drives and joints, as `largest_box` takes it."""
        bound = None if self.deflection is None else (self.force, self.plane, self.deflection)
        return {
            "transmission": self.transmission, "length": self.length, "clearance": self.clearance,
            "deflection": bound, "rotation": self.rotation, "threads": self.threads,
        }  # fmt: skip

    @property
    def motion(self) -> Motion:
        """The toolpath; StiffmapError where there is none."""
        if self.toolpath is None:
            raise StiffmapError("needs a toolpath: give toolpath in the requirements, or toolpath=")
        return self.toolpath

    def path(self, most: int) -> tuple[Floats, Floats]:
        """Positions (n, 3) m and forces (n, 3) N along the toolpath, `most` samples or a few more.

        StiffmapError where there is no toolpath.
        """
        position, force = self.motion.places()
        step = max(1, len(position) // most)
        return position[::step], force[::step]

    @cached_property
    def positions(self) -> Floats:
        """(nodes³, 3) m."""
        return box_nodes(self.low, self.high, self.nodes)

    @cached_property
    def coarse_positions(self) -> Floats:
        """(coarse³, 3) m, for measures that cost more."""
        return box_nodes(self.low, self.high, self.coarse)

    @cached_property
    def kinematics(self) -> DriveKinematics:
        """At `positions`."""
        if self.scheduler is None:
            return _closed((self.machine, self.rotation, self.threads), self.positions)
        with workers(_closed, (self.machine, self.rotation, 1), scheduler=self.scheduler) as hands:
            p = self.positions
            parts = hands.in_order(p[k : k + CHUNK] for k in range(0, len(p), CHUNK))
        names = [f.name for f in fields(DriveKinematics)]
        return DriveKinematics(**{n: np.concatenate([getattr(k, n) for k in parts]) for n in names})

    @cached_property
    def factors(self) -> VelocityTransmission:
        """Velocity transmission at `positions`."""
        return transmission_of(self.machine, self.kinematics, length=self.length)

    @cached_property
    def coarse_kinematics(self) -> DriveKinematics:
        """At `coarse_positions`."""
        return drive_kinematics(self.machine, self.coarse_positions, self.rotation, threads=self.threads)


def _closed(shared: tuple[Machine, Floats | None, int | None], position: Floats) -> DriveKinematics:
    """Poses (n, 3) m closed from the unloaded equilibria, as a task."""
    machine, rotation, threads = shared
    start = kernel_starts(machine, position, rotation, threads)
    return drive_kinematics(machine, position, rotation, start=start, threads=threads)


@dataclass(frozen=True, eq=False)
class Found:
    """A measure of one machine: its decisive values, and the map where there is one."""

    worst: float
    worst_at: Floats | None = None
    best: float = float("nan")
    best_at: Floats | None = None
    note: str = ""
    positions: Floats | None = None
    values: Floats | None = None
    extra: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Measure:
    """One measure of §3: SI `unit`, and its unit and factor in print."""

    name: str
    title: str
    unit: str
    better: str
    """``high`` or ``low``: which values are good."""
    compute: Callable[[Case], Found]
    shown: str = ""
    factor: float = 1.0
    order: int = 50
    apart: bool = False
    """Whether it asks the case for numbers only, nothing that measures share, so that it may run in parallel."""


def over_poses(positions: Floats, values: Floats, better: str, note: str = "", **extra: object) -> Found:
    """Worst and best pose of a map; a failed pose (NaN) makes the worst NaN and is said to be so."""
    good = np.isfinite(values)
    if not good.any():
        note = note or "no pose of the box is within reach"
        return Found(float("nan"), note=note, positions=positions, values=values)
    sign = 1.0 if better == "high" else -1.0
    score = np.where(good, sign * values, -np.inf)
    best, failed = int(np.argmax(score)), int((~good).sum())
    worst = int(np.argmin(good if failed else score))
    value = float("nan") if failed else float(values[worst])
    note = note or (f"{failed} of {len(good)} poses fail" if failed else "")
    return Found(
        value, positions[worst], float(values[best]), positions[best], note, positions, values, extra
    )


@lru_cache
def all_measures() -> tuple[Measure, ...]:
    """Every measure, in the order of the table."""
    found = (m for kind in modules_of(kinds) for m in getattr(kind, "MEASURES", None) or (kind.MEASURE,))
    return tuple(sorted(found, key=lambda m: (m.order, m.name)))


def get_measure(name: str) -> Measure:
    """By name; StiffmapError lists those that exist."""
    known = {m.name: m for m in all_measures()}
    if name not in known:
        raise StiffmapError(f"unknown measure '{name}'; known: {', '.join(known)}")
    return known[name]

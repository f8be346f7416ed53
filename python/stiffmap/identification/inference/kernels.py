"""Covariances of what nobody can name: smooth gaps over the workspace, common errors of a pose, time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from stiffmap.experiment.experiment import Experiment, Floats, Integers, Mask
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.solve.machine import Machine

LENGTHS = (0.6, 2.0)
"""Of the workspace's half: one bend, three bends (Matérn-5/2)."""
SESSIONS = (0.07, 1.0)
"""Correlation times, in sessions."""
FEW_DRIVES = 3
"""Drives up to which the place of the tool says what their coordinates do."""
TOUCHED = 0.1
"""Share of a height's spread that its sum with the commanded height keeps where the command was the reading."""


@dataclass(frozen=True, eq=False)
class ReadingPoints:
    """Readings: row, channel and noise (m, rad) of each of N."""

    rows: Integers
    channel: Integers
    sigma: Floats

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, eq=False)
class Kernel:
    """A covariance of any scale of readings in units of their noise."""

    kind: str
    """``field``, ``pose`` or ``time``."""
    name: str
    between: Callable[[ReadingPoints, ReadingPoints], Floats]
    """(N, M)."""
    own: Callable[[ReadingPoints], Floats]
    """(N,) variances."""
    label: Callable[[ReadingPoints], Integers] | None = None
    """(N,) number of the block that each reading is in, where it is one within blocks and zero between them."""


def gaps(machine: Machine, e: Experiment, points: ReadingPoints) -> Iterator[Kernel]:
    """What nobody can name that some readings can hold."""
    angle = np.array([c.unit == "rad" for c in e.channels])
    load = e.wrench / max(float(np.abs(e.wrench).max(initial=0.0)), 1e-300)
    for what, here in (("lengths", ~angle), ("angles", angle)):
        if not here[points.channel].any():
            continue
        for over, x in _spaces(machine, e):
            for length in LENGTHS:
                yield _field(f"field of {what} over {over}, {length:g}", here, x / length, None)
                if e.quantity == "deflection":
                    yield _field(f"compliance of {what} over {over}, {length:g}", here, x / length, load)
    yield from shared(e, points)
    when = e.hours if e.hours is not None else e.order
    if when is not None:
        t = _in_sessions(when, e.runs)
        for length in SESSIONS:
            yield _wander(f"wander over {length:g} session", t / length, e.runs)


def _field(name: str, here: Mask, x: Floats, load: Floats | None) -> Kernel:
    """Over places x (n, k) in lengths, of channels `here` (c,); with `load` (n, 6) times load with load."""

    def between(a: ReadingPoints, b: ReadingPoints) -> Floats:
        same = (a.channel[:, None] == b.channel) & here[a.channel][:, None]
        k = same * matern(cdist(x[a.rows], x[b.rows])) / np.outer(a.sigma, b.sigma)
        return np.asarray(k if load is None else k * (load[a.rows] @ load[b.rows].T))

    def own(a: ReadingPoints) -> Floats:
        carried = 1.0 if load is None else np.sum(load[a.rows] ** 2, axis=1)
        return np.asarray(here[a.channel] * carried / a.sigma**2)

    return Kernel("field", name, between, own)


def _wander(name: str, t: Floats, session: Integers) -> Kernel:
    """Over times t (n,) in lengths, within sessions (n,)."""

    def between(a: ReadingPoints, b: ReadingPoints) -> Floats:
        together = (a.channel[:, None] == b.channel) & (session[a.rows][:, None] == session[b.rows])
        return np.asarray(together * np.exp(-np.abs(t[a.rows][:, None] - t[b.rows])))

    return Kernel("time", name, between, lambda a: np.ones(len(a)))


def blocks(kind: str, name: str, of: Integers, channels: int) -> Kernel:
    """Of readings of one channel whose rows have the same number (n,)."""

    def label(a: ReadingPoints) -> Integers:
        return np.asarray(of[a.rows] * channels + a.channel)

    def between(a: ReadingPoints, b: ReadingPoints) -> Floats:
        return np.asarray(label(a)[:, None] == label(b), dtype=float)

    return Kernel(kind, name, between, lambda a: np.ones(len(a)), label)


def shared(e: Experiment, points: ReadingPoints) -> Iterator[Kernel]:
    """What readings of one condition and of one pose share; nothing where that is the noise, or the one before, itself."""
    number = len(points)
    for name, of in (("condition", e.conditions), ("pose", e.groups)):
        kernel = blocks("pose", name, of, len(e.channels))
        assert kernel.label is not None
        found = len(np.unique(kernel.label(points)))
        if found < number:
            yield kernel
            number = found


def matern(distance: Floats) -> Floats:
    """Matérn-5/2 correlation at distances in lengths."""
    a = np.sqrt(5.0) * distance
    return np.asarray((1.0 + a + a * a / 3.0) * np.exp(-a))


def _spaces(machine: Machine, e: Experiment) -> Iterator[tuple[str, Floats]]:
    """(n, k) coordinates in -1 ... 1: of the drives, and of the tool where there are many drives."""
    names = machine.compiled.names.joints
    drives = [names[a] for a in machine.actuators]
    q = coordinates_of(machine, e)[:, drives]
    if np.isfinite(q).all():
        yield "drives", unit(q)
        if len(drives) <= FEW_DRIVES:
            return
    yield "place", unit(free_position(e))


def _in_sessions(when: Floats, session: Integers) -> Floats:
    """Times in shares of the longest session."""
    longest = max((float(np.ptp(when[session == k])) for k in np.unique(session)), default=0.0)
    return np.asarray(when / (longest or 1.0))


def free_position(e: Experiment) -> Floats:
    """(n, 3) m, commanded positions; where a surface was touched, without the coordinate that was the reading."""
    names = [c.name for c in e.channels]
    if "hh" not in names:
        return e.position
    normal = np.array(e.normal)
    height = e.position @ normal
    reading = e.reading[:, names.index("hh")]
    if not np.nanstd(reading + height) < TOUCHED * np.nanstd(reading):
        return e.position
    along = np.abs(normal) == np.abs(normal).max()
    return np.asarray(np.where(along, 0.0, e.position - np.outer(height, normal)))


def unit(x: Floats) -> Floats:
    """Columns mapped to [-1, 1]; constant ones to 0."""
    low, high = x.min(axis=0), x.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    return np.asarray(np.where(high > low, 2 * (x - low) / span - 1, 0.0))

"""The covariance of what a machine does not explain: smooth gaps over the workspace, common errors of a pose, time.

As a factor it is of low rank beyond the noise, V = D + F Fᵀ. Smooth kernels are known by some of the readings (Nyström), blocks of
readings that share an error by one column each; what that leaves of each reading's own variance is noise (Snelson, Ghahramani,
NIPS 18 (2006) 1257).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.spatial.distance import cdist

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.solve.machine import Machine

LENGTHS = (0.6, 2.0)
"""Of the workspace's half: one bend, three bends (Matérn-5/2)."""
SESSIONS = (0.07, 1.0)
"""Correlation times, in sessions."""
WANDER = "wander"
"""With what the names of parts begin that go on over time."""
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
        yield from wandering(e, when)


def wandering(e: Experiment, when: Floats) -> Iterator[Kernel]:
    """What carries over from one reading to the next by times (n,)."""
    longest = max((float(np.ptp(when[e.runs == k])) for k in np.unique(e.runs)), default=0.0)
    t = when / (longest or 1.0)  # in shares of the longest session
    for length in SESSIONS:
        yield _wander(f"{WANDER} over {length:g} session", t / length, e.runs)


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


MOST_BLOCKS = 600
"""Blocks that have a column, those of most readings first. Effort only."""
ROUND_OFF = 1e-10
"""Of the mean variance: what is added where a kernel cannot be factorised."""


@dataclass(frozen=True, eq=False)
class Covariance:
    """Of N readings, in declared noise."""

    noise: Floats
    """(N,) D."""
    factor: Floats
    """(N, M) F."""

    @cached_property
    def _directions(self) -> tuple[Floats, Floats, Floats]:
        """(N,) D^½, (N, k) orthonormal U and (k,) s² with D^-½ F Fᵀ D^-½ = U diag(s²) Uᵀ."""
        root = np.sqrt(self.noise)
        scaled = self.factor / root[:, None]
        size, vectors = np.linalg.eigh(scaled.T @ scaled)
        kept = size > 1e-12 * max(float(size.max(initial=0.0)), 1.0)
        return root, scaled @ (vectors[:, kept] / np.sqrt(size[kept])), size[kept]

    def white(self, values: Floats) -> Floats:
        """(N, ...) V^-½ values."""
        root, _, size = self._directions
        scaled = (values.reshape(len(root), -1) / root[:, None]) if values.ndim > 1 else values / root
        return self._stretched(1.0 / np.sqrt(1.0 + size), scaled).reshape(values.shape)

    def coloured(self, white: Floats) -> Floats:
        """(N, p) V^½ of whitened values."""
        root, _, size = self._directions
        return np.asarray(root[:, None] * self._stretched(np.sqrt(1.0 + size), white))

    def noise_part(self, white: Floats) -> Floats:
        """(N,) posterior mean of the noise, by whitened readings."""
        root, _, size = self._directions
        return np.asarray(root * self._stretched(1.0 / np.sqrt(1.0 + size), white))

    def _stretched(self, by: Floats, values: Floats) -> Floats:
        """(N,) or (N, p) values, along each of the directions U so many times as long (k,)."""
        u = self._directions[1]
        return np.asarray(values + u @ (((by - 1.0) * (u.T @ values).T).T))

    def only(self, keep: Mask) -> Covariance:
        """Of some readings (N,)."""
        return Covariance(self.noise[keep], self.factor[keep])


def covariance(
    points: ReadingPoints,
    some: ReadingPoints,
    kernels: Sequence[tuple[Kernel, float]],
    noise: Floats,
    more: Floats,
) -> Covariance:
    """Of kernels with their variances, known by some readings; `noise` (N,) and further columns `more` (N, k) of the factor."""
    smooth = [(k, v) for k, v in kernels if k.label is None]
    parts, own = [more], noise.copy()
    if smooth:
        inner = sum((v * k.between(some, some) for k, v in smooth), np.zeros((len(some), len(some))))
        inner[np.diag_indices(len(inner))] += ROUND_OFF * max(float(np.trace(inner)) / len(inner), 1e-300)
        across = sum((v * k.between(some, points) for k, v in smooth), np.zeros((len(some), len(points))))
        found = solve_triangular(cholesky(inner, lower=True), across, lower=True).T
        whole = sum((v * k.own(points) for k, v in smooth), np.zeros(len(points)))
        own += np.maximum(whole - np.sum(found**2, axis=1), 0.0)
        parts.append(found)
    for k, v in kernels:
        if k.label is not None:
            columns = _columns(k.label(points))
            parts.append(np.sqrt(v * k.own(points))[:, None] * columns)
            own += v * k.own(points) * (1.0 - columns.sum(axis=1))
    return Covariance(own, np.hstack(parts))


def _columns(label: np.ndarray[tuple[int, ...], np.dtype[np.intp]]) -> Floats:
    """(N, k) one where a reading is in a block of several."""
    _, number, count = np.unique(label, return_inverse=True, return_counts=True)
    chosen = [b for b in np.argsort(-count, kind="stable")[:MOST_BLOCKS] if count[b] > 1]
    return np.asarray(number.reshape(-1)[:, None] == np.array(chosen, dtype=np.intp), dtype=float)

"""What keeps a pose inside the workspace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from stiffmap.common.broadcasting import Floats, instance_of, one_of, real_array, real_number, refused
from stiffmap.common.errors import StiffmapError
from stiffmap.common.rotations import as_rotations
from stiffmap.model.description.machine import TASK
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import magnitude
from stiffmap.workspace.performance.limits.bars import Bars
from stiffmap.workspace.performance.limits.deflection import worst_deflection
from stiffmap.workspace.performance.motion.closing import (
    DriveKinematics,
    characteristic_length,
    drive_kinematics,
    kernel_starts,
    weighted,
)
from stiffmap.workspace.performance.motion.many_drives import inverse_rows, worst_corner

UNLIMITED = 1e299


@dataclass(frozen=True, eq=False)
class Limit:
    """One bound ``value <= most`` at poses (n,), of a smooth array."""

    name: str
    value: Floats  # (n,)
    most: float
    array: Floats  # (n, a) the smooth array, in the unit of `value`: |change of value| <= |change of array|
    left: Floats
    """(n, a): a lower estimate of the value at a neighbour is left·(array there), the value being convex."""


def factor_limits(factors: str, transmission: tuple[float, float]) -> tuple[str, str]:
    """Names of the limits of a transmission range: ``transmission below 0.5``, ``transmission above 2``."""
    sort = "transmission" if factors == "sphere" else "cube factor"
    return f"{sort} below {transmission[0]:g}", f"{sort} above {transmission[1]:g}"


KNOWN = 4000  # closed poses that are kept as starts, about


@dataclass(frozen=True)
class Bounds:
    """What a workspace asks of a pose; see `stiffmap.workspace.performance.largest_box`."""

    machine: Machine
    counter: list[int] = field(default_factory=lambda: [0])
    known: list[tuple[Floats, Floats]] = field(default_factory=list)
    """Positions and coordinates of poses that were closed, as starts for others: none or one entry."""
    _: KW_ONLY
    norm: str = "sphere"
    length: float | None = None
    ranges: bool = True
    joints: bool = True
    clearance: float | None = None
    deflection: tuple[float, str | None, float] | None = None
    """N, plane, m: force in its worst direction there, and the largest deflection."""
    rotation: ArrayLike | None = None  # (3, 3); None: as at home
    threads: int | None = None
    transmission: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.rotation is not None:
            object.__setattr__(self, "rotation", as_rotations(real_array(self.rotation, "rotation")))
        if self.transmission is not None:
            what = "(lowest, highest) with 0 <= lowest < highest"
            ends = real_array(self.transmission, "transmission", what)
            if ends.shape != (2,) or not 0 <= ends[0] < ends[1]:
                raise refused("transmission", what, repr(self.transmission))
        one_of(self.norm, ("sphere", "cube"), "norm")
        if self.clearance is not None:
            magnitude(self.clearance, "clearance", "m")
        if self.deflection is not None:
            what = "(force in N, plane, most in m)"
            given = instance_of(self.deflection, (tuple, list), "deflection", what)
            if len(given) != 3 or not all(real_number(given[i], "deflection", what) > 0 for i in (0, 2)):
                raise StiffmapError(f"deflection: expected {what}, both positive, got {given!r}")

    @cached_property
    def bars(self) -> Bars:
        """Straight members whose clearance counts."""
        return Bars(self.machine)

    @cached_property
    def unproven(self) -> str:
        """Empty where cells can be proven, else why their nodes must do."""
        compiled, drives = self.machine.compiled, len(self.machine.actuators)
        if self.deflection is not None:
            return "a deflection has no bound between poses"
        if compiled.core.not_enclosed:
            return compiled.core.not_enclosed
        if self.transmission is not None and (drives not in (3, 6) or self.machine.description.task != TASK):
            return "drives and commanded motions are not as many"
        return ""

    def at(self, position: Floats) -> tuple[NDArray[np.bool_], list[Limit]]:
        """Which poses (n, 3) close, and the limits there."""
        k = self.closed(position)
        return k.status == Status.CONVERGED, self.limits_of(k, position)

    def limits_of(self, k: DriveKinematics, position: Floats) -> list[Limit]:
        """The limits at poses (n, 3) whose kinematics are at hand."""
        closed = k.status == Status.CONVERGED
        limits: list[Limit] = []
        if self.transmission is not None:
            limits.extend(self._factors(k, closed))
        for index, name, sign, most in self.intervals_wanted:
            limits.append(plain(name, sign * k.coordinates[:, index], most))
        if self.clearance is not None:
            value = -self.bars.least_distance(k.coordinates)
            limits.append(plain("clearance of bars", value, -self.clearance))
        if self.deflection is not None:
            limits.append(self._deflection(position, closed))
        return limits

    def closed(self, position: Floats) -> DriveKinematics:
        """Kinematics at poses, begun at the kernels' answer, else at the nearest pose that was closed before."""
        self.counter[0] += len(position)
        start = kernel_starts(self.machine, position, self.rotation, self.threads)
        far = np.ones(len(position), dtype=bool) if start is None else np.isnan(start[:, 0])
        if self.known and far.any():
            there, coordinates = self.known[0]
            start = np.empty((len(position), coordinates.shape[1])) if start is None else start
            start[far] = coordinates[cKDTree(there).query(position[far])[1]]
        k = drive_kinematics(
            self.machine, position, self.rotation, start=start, patient=False, threads=self.threads
        )
        good = k.status == Status.CONVERGED
        if good.any() and (not self.known or len(self.known[0][0]) < KNOWN):
            new, there = position[good], k.coordinates[good]
            if self.known:
                new = np.concatenate([self.known[0][0], new])
                there = np.concatenate([self.known[0][1], there])
            self.known[:] = [(new, there)]
        return k

    def inside(self, position: Floats) -> NDArray[np.bool_]:
        """Which poses (n, 3) close and keep all limits."""
        closed, limits = self.at(position)
        good = closed.copy()
        for limit in limits:
            good &= limit.value <= limit.most
        return good

    def _factors(self, k: DriveKinematics, closed: NDArray[np.bool_]) -> list[Limit]:
        assert self.transmission is not None
        j = weighted(self.machine, k.jacobian, self.size, "all")
        low, high = self.transmission
        sphere, out = self.norm == "sphere", list[Limit]()
        below, above = factor_limits(self.norm, self.transmission)
        if np.isfinite(high):
            most = convex(above, j, high, closed, spectral if sphere else vertices)
            # the change of a corner is at most sqrt(d) times that of the matrix
            scale = 1.0 if sphere else float(np.sqrt(j.shape[2]))
            out.append(replace(most, array=scale * most.array, left=most.left / scale))
        if low > 0:
            out.append(convex(below, inverse_rows(j), 1 / low, closed, spectral if sphere else rows))
        return out

    @cached_property
    def size(self) -> float:
        """Characteristic length, m."""
        return characteristic_length(self.machine, self.length)

    @cached_property
    def intervals_wanted(self) -> list[tuple[int, str, float, float]]:
        """Index, name, sign and most of that sign times the coordinate, of each end of a range that counts."""
        compiled, drives = self.machine.compiled, set(self.machine.compiled.drives)
        out = []
        for i, (low, high) in enumerate(compiled.core.limits):
            if self.ranges if i in drives else self.joints:
                name = f"{'range of' if i in drives else 'joint limit of'} {compiled.names.coordinates[i]}"
                ends = ((1.0, high), (-1.0, -low))
                out += [(i, name, sign, most) for sign, most in ends if abs(most) < UNLIMITED]
        return out

    def _deflection(self, position: Floats, closed: NDArray[np.bool_]) -> Limit:
        assert self.deflection is not None
        force, plane, most = self.deflection
        value = np.full(len(position), np.inf)
        if closed.any():
            d = worst_deflection(
                self.machine, position[closed], force=force, plane=plane, turns=0, rotation=self.rotation,
                threads=self.threads,
            )  # fmt: skip
            value[closed] = np.where(np.isfinite(d.values), d.values, np.inf)
        return plain("deflection", value, most)


def plain(name: str, value: Floats, most: float) -> Limit:
    """A limit on a smooth number (n,) itself."""
    return Limit(name, value, most, value[:, None], np.ones((len(value), 1)))


Largest = Callable[[Floats], tuple[Floats, Floats]]
"""Of matrices (k, r, c): a convex value (k,), and (k, r, c) its slope, a linear lower estimate at neighbours."""


def convex(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_], largest: Largest) -> Limit:
    """A limit on matrices (n, r, c); infinite where the pose is not closed."""
    n, size = len(matrix), matrix.shape[1] * matrix.shape[2]
    value, left = np.full(n, np.inf), np.full(matrix.shape, np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        value[ok], left[ok] = largest(matrix[ok])
    return Limit(name, value, most, matrix.reshape(n, size), left.reshape(n, size))


def spectral(a: Floats) -> tuple[Floats, Floats]:
    """Largest singular value, and its dyad."""
    wide = a.shape[2] > a.shape[1]
    a = np.swapaxes(a, 1, 2) if wide else a
    # quicker than svd, exact enough for the largest
    v = np.linalg.eigh(np.swapaxes(a, 1, 2) @ a)[1][:, :, -1]
    image = (a @ v[:, :, None])[:, :, 0]
    size = np.linalg.norm(image, axis=1)
    u = image / np.maximum(size, 1e-300)[:, None]
    u, v = (v, u) if wide else (u, v)
    return size, u[:, :, None] * v[:, None, :]


def vertices(a: Floats) -> tuple[Floats, Floats]:
    """Farthest corner of the image of the cube: the norm of J s for the worst s."""
    signs = worst_corner(a)[:, None, :]
    image = (a * signs).sum(axis=2)
    value = np.linalg.norm(image, axis=1)
    return value, (image / value[:, None])[:, :, None] * signs


def rows(a: Floats) -> tuple[Floats, Floats]:
    """Longest row of the inverse: the drive that first stops a motion."""
    norms, every = np.linalg.norm(a, axis=2), np.arange(len(a))
    worst = np.argmax(norms, axis=1)
    value = norms[every, worst]
    pick = np.zeros_like(a)
    pick[every, worst] = a[every, worst] / value[:, None]
    return value, pick

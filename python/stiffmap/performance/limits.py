"""What keeps a pose inside the workspace: limits at poses, and largest values over whole cells (theory D8)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from stiffmap.broadcasting import Floats, thread_count
from stiffmap.description.machine import TASK
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.performance.bars import Bars
from stiffmap.performance.closing import DriveKinematics, drive_kinematics, kernel_starts
from stiffmap.performance.scaling import characteristic_length, revolute_drives, weighted
from stiffmap.performance.zonotopes import corners, inverse_rows
from stiffmap.status import Status

UNLIMITED = 1e299
BOX = np.array(list(product((-1.0, 1.0), repeat=3)))


KNOWN = 4000
"""Closed poses that are kept as starts, about."""


@dataclass(frozen=True, eq=False)
class Limit:
    """One bound ``value <= most`` at poses (n,), of a smooth array."""

    name: str
    value: Floats
    """(n,)"""
    most: float
    array: Floats
    """(n, a) the smooth array, in the unit of `value`: |change of value| <= |change of array|."""
    left: Floats
    """(n, a): a lower estimate of the value at a neighbour is left·(array there), the value being convex."""


@dataclass(frozen=True, eq=False)
class Cells:
    """What was proven of cells of positions (n)."""

    inside: NDArray[np.bool_]
    """Every pose of the cell closes and keeps all limits."""
    broken: NDArray[np.bool_]
    """Some pose of it does not."""
    where: Floats
    """(n, 3) that pose, from the centre, along the cell's axes."""
    limit: NDArray[np.int64]
    """Index into `names` of the limit nearest to its bound, or beyond."""
    names: tuple[str, ...]
    bend: Floats
    """(n, 3) share of each axis in the curvature; NaN: unknown."""


@dataclass(frozen=True)
class Bounds:
    """What a workspace asks of a pose; see `stiffmap.performance.largest_box`."""

    machine: Machine
    rotation: Floats | None = None
    transmission: tuple[float, float] | None = None
    factors: str = "sphere"
    length: float | None = None
    ranges: bool = True
    joints: bool = True
    clearance: float | None = None
    deflection: tuple[float, str | None, float] | None = None
    """N, plane, m: force in its worst direction there, and the largest deflection."""
    threads: int | None = None
    counter: list[int] = field(default_factory=lambda: [0])
    known: list[tuple[Floats, Floats]] = field(default_factory=list)
    """Positions and coordinates of poses that were closed, as starts for others: none or one entry."""

    def __post_init__(self) -> None:
        if self.transmission is not None:
            low, high = self.transmission
            if not 0 <= low < high:
                raise StiffmapError(
                    f"transmission: expected (lowest, highest) with 0 <= lowest < highest, got ({low}, {high})"
                )
        if self.factors not in ("sphere", "cube"):
            raise StiffmapError(
                f"factors: expected 'sphere' (singular values) or 'cube' (each drive within its limit), got {self.factors!r}"
            )
        if self.clearance is not None and not self.clearance > 0:
            raise StiffmapError(f"clearance: expected a positive distance in m, got {self.clearance!r}")
        if self.deflection is not None and not (self.deflection[0] > 0 and self.deflection[2] > 0):
            raise StiffmapError(
                f"deflection: expected (force in N, plane, most in m), both positive, got {self.deflection!r}"
            )

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
        if compiled.not_enclosed:
            return compiled.not_enclosed
        if self.transmission is not None and (drives not in (3, 6) or self.machine.description.task != TASK):
            return "drives and commanded motions are not as many"
        return ""

    # At poses -------------------------------------------------------------------------------------

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
        limits.extend(self.intervals(k.coordinates))
        if self.clearance is not None:
            limits.append(self._clearance(k))
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
        out = []
        if self.factors == "cube":
            if np.isfinite(high):
                out.append(_vertices("cube factor above", j, high, closed))
            if low > 0:
                out.append(_rows("cube factor below", inverse_rows(j), 1 / low, closed))
            return out
        if np.isfinite(high):
            out.append(_spectral("transmission above", j, high, closed))
        if low > 0:
            out.append(_spectral("transmission below", inverse_rows(j), 1 / low, closed))
        return out

    @cached_property
    def size(self) -> float:
        """Characteristic length, m."""
        return characteristic_length(self.machine, self.length)

    @cached_property
    def _coordinates(self) -> list[tuple[int, str, float, float]]:
        return _coordinate_limits(self.machine, self.ranges, self.joints)

    def intervals(self, x: Floats) -> list[Limit]:
        """Ranges of drives and limits of joints at coordinates (n, coordinates)."""
        out = []
        for index, name, low, high in self._coordinates:
            for sign, most in ((1.0, high), (-1.0, -low)):
                if abs(most) < UNLIMITED:
                    value = sign * x[:, index]
                    out.append(Limit(name, value, most, value[:, None], np.ones((len(x), 1))))
        return out

    def _clearance(self, k: DriveKinematics) -> Limit:
        assert self.clearance is not None
        value = -self.bars.least_distance(k.coordinates)
        return Limit("clearance of bars", value, -self.clearance, value[:, None], np.ones((len(value), 1)))

    def _deflection(self, position: Floats, closed: NDArray[np.bool_]) -> Limit:
        from stiffmap.performance.deflection import worst_deflection

        assert self.deflection is not None
        force, plane, most = self.deflection
        value = np.full(len(position), np.inf)
        if closed.any():
            d = worst_deflection(
                self.machine, position[closed], force=force, plane=plane, turns=0, rotation=self.rotation,
                threads=self.threads,
            )  # fmt: skip
            value[closed] = np.where(np.isfinite(d.values), d.values, np.inf)
        return Limit("deflection", value, most, value[:, None], np.ones((len(value), 1)))

    # Over cells -----------------------------------------------------------------------------------

    def over(self, centre: Floats, half: Floats, axes: Floats) -> Cells:
        """Cells (n, 3) of positions, base axes, with half lengths (n, 3) along the columns of `axes`."""
        self.counter[0] += len(centre)
        compiled = self.machine.compiled
        drives = list(compiled.drives)
        wide = self.transmission is not None and len(drives) == 6
        watched = self.bars.nodes if self.clearance is not None else ()
        rotation = compiled.home_rotation if self.rotation is None else self.rotation
        start = kernel_starts(self.machine, centre, self.rotation, self.threads)
        e = compiled.enclose(
            np.ascontiguousarray(centre), np.ascontiguousarray(half), axes, rotation, start=start,
            slopes=6 if wide else 3, watched=watched, threads=thread_count(self.threads),
        )  # fmt: skip
        ok = np.asarray(e["enclosed"])
        names, most, least = (
            ["closure"],
            [np.where(ok, -np.inf, np.inf)],
            [np.where(e["closed"], -np.inf, np.inf)],
        )
        places = [np.zeros_like(half)]

        def add(name: str, value: Floats, slack: Floats, bound: float, place: Floats) -> None:
            """A limit's value at its worst corner, by the linear model, and what that may miss."""
            size = max(abs(bound), 1e-9)
            names.append(name)
            with np.errstate(invalid="ignore"):
                most.append(np.where(ok, (value + slack - bound) / size, np.inf))
                least.append(np.where(ok, (value - slack - bound) / size, -np.inf))
            places.append(place)

        x = e["coordinates"]
        for index, name, low, high in self._coordinates:
            for sign, bound in ((1.0, high), (-1.0, -low)):
                if abs(bound) < UNLIMITED:
                    slope = sign * e["slope"][:, index, :3]
                    value = sign * x[:, index] + (np.abs(slope) * half).sum(axis=1)
                    add(name, value, e["radius"][:, index], bound, np.where(slope < 0, -1.0, 1.0) * half)
        if self.clearance is not None:
            d, moved = self.bars.over(e["points"], e["moved"])
            add("clearance of bars", -d, moved, -self.clearance, np.zeros_like(half))
        if self.transmission is not None:
            frame = np.eye(6)
            frame[:3, :3] = axes
            turn = revolute_drives(self.machine)
            rows = np.where(turn, self.size, 1.0)[:, None]
            columns = np.concatenate([np.ones(3), np.full(3, 1 / self.size)])[: 6 if wide else 3]
            scale = rows * columns
            w = e["slope"][:, drives] * scale
            change = e["change"][:, :, drives] * scale
            slack = np.linalg.norm(e["slack"][:, drives] * scale, axis=(1, 2))
            for name, value, rest, bound, corner in _factors_over(
                w, change * half[:, :, None, None], slack, self.transmission, self.factors
            ):
                add(name, value, rest, bound, BOX[corner] * half)
        table, sure = np.stack(most), np.stack(least)
        table, sure = np.where(np.isnan(table), np.inf, table), np.where(np.isnan(sure), -np.inf, sure)
        broken, worst = (sure > 0).any(axis=0), np.argmax(sure, axis=0)
        limit = np.where(broken, worst, np.argmax(table, axis=0))
        where = np.stack(places)[worst, np.arange(len(centre))]
        inside = np.asarray((table <= 0).all(axis=0))
        return Cells(inside, np.asarray(broken), where, limit, tuple(names), np.asarray(e["bend"]))


def _factors_over(
    w: Floats, step: Floats, slack: Floats, transmission: tuple[float, float], factors: str
) -> list[tuple[str, Floats, Floats, float, NDArray[np.int64]]]:
    """Name, value at the worst corner by the linear model, what it may miss, bound and number of that corner,
    from W = J^-1 (n, d, d), its change to the cell's faces (n, 3, d, d), the Frobenius norm of the rest (n,)."""
    low, high = transmission
    n, d = len(w), w.shape[-1]
    out = []
    sphere = factors == "sphere"
    ok = np.isfinite(w).all(axis=(1, 2)) & np.isfinite(slack)
    if low > 0:
        at = w[ok][:, None] + np.einsum("ck,nkab->ncab", BOX, step[ok])
        values = _largest(at) if sphere else np.linalg.norm(at, axis=3).max(axis=2)
        name = "transmission below" if sphere else "cube factor below"
        out.append((name, *_spread(n, ok, values, slack[ok]), 1 / low, _worst(n, ok, values)))
    if not np.isfinite(high):
        return out
    ok = ok & (np.abs(np.linalg.det(np.where(ok[:, None, None], w, np.eye(d)))) > 1e-12)
    v = np.linalg.inv(w[ok])
    relative = v[:, None] @ step[ok]
    size = _largest(v)
    # J = (1 + Z)^-1 V with Z = V (step + rest): its part of first order is exact, the others are bounded
    z = _largest(np.einsum("ck,nkab->ncab", BOX, relative)).max(axis=1) + size * slack[ok]
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.where(z < 1, (z**2 / (1 - z) + size * slack[ok]) * size, np.inf)
    at = v[:, None] - np.einsum("ck,nkab->ncab", BOX, relative @ v[:, None])
    if sphere:
        values = _largest(at)
    else:
        values, rest = np.linalg.norm(at @ corners(d).T, axis=2).max(axis=2), rest * np.sqrt(d)
    name = "transmission above" if sphere else "cube factor above"
    out.append((name, *_spread(n, ok, values, rest), high, _worst(n, ok, values)))
    return out


def _spread(n: int, ok: NDArray[np.bool_], values: Floats, rest: Floats) -> tuple[Floats, Floats]:
    value, slack = np.full(n, np.nan), np.full(n, np.inf)
    value[ok], slack[ok] = values.max(axis=1), rest
    return value, slack


def _worst(n: int, ok: NDArray[np.bool_], values: Floats) -> NDArray[np.int64]:
    out = np.zeros(n, dtype=np.int64)
    out[ok] = values.argmax(axis=1)
    return out


def _largest(a: Floats) -> Floats:
    """(...) largest singular value."""
    gram = np.swapaxes(a, -1, -2) @ a
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(gram)[..., -1], 0.0)))


def _coordinate_limits(machine: Machine, ranges: bool, joints: bool) -> list[tuple[int, str, float, float]]:
    compiled = machine.compiled
    drives = set(compiled.drives)
    out = []
    for i, (low, high) in enumerate(compiled.limits):
        wanted = ranges if i in drives else joints
        if wanted and (abs(low) < UNLIMITED or abs(high) < UNLIMITED):
            kind = "range of" if i in drives else "joint limit of"
            out.append((i, f"{kind} {compiled.names.coordinates[i]}", low, high))
    return out


def _spectral(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Largest singular value, and its dyad: a linear lower estimate at neighbours."""
    n = len(matrix)
    value = np.full(n, np.inf)
    left = np.full((n, matrix.shape[1] * matrix.shape[2]), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        a = matrix[ok]
        wide = a.shape[2] > a.shape[1]
        a = np.swapaxes(a, 1, 2) if wide else a
        v = np.linalg.eigh(np.swapaxes(a, 1, 2) @ a)[1][
            :, :, -1
        ]  # quicker than svd, exact enough for the largest
        image = (a @ v[:, :, None])[:, :, 0]
        value[ok] = size = np.linalg.norm(image, axis=1)
        u = image / np.maximum(size, 1e-300)[:, None]
        u, v = (v, u) if wide else (u, v)
        left[ok] = (u[:, :, None] * v[:, None, :]).reshape(len(a), -1)
    return Limit(name, value, most, matrix.reshape(n, left.shape[1]), left)


def _vertices(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Farthest corner of the image of the cube: the norm of J s for the worst s."""
    n, rows, d = matrix.shape
    value, left = np.full(n, np.inf), np.full((n, rows * d), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        signs = corners(d)
        images = matrix[ok] @ signs.T
        norms = np.linalg.norm(images, axis=1)
        worst = np.argmax(norms, axis=1)
        rows_of = np.arange(len(worst))
        value[ok] = norms[rows_of, worst]
        unit = images[rows_of, :, worst] / value[ok][:, None]
        left[ok] = (unit[:, :, None] * signs[worst][:, None, :]).reshape(len(worst), -1)
    # the change of the value is at most sqrt(d) times that of the matrix
    return Limit(name, value, most, np.sqrt(d) * matrix.reshape(n, rows * d), left / np.sqrt(d))


def _rows(name: str, matrix: Floats, most: float, closed: NDArray[np.bool_]) -> Limit:
    """Longest row of the inverse: the drive that first stops a motion."""
    n, d, columns = matrix.shape
    value, left = np.full(n, np.inf), np.full((n, d * columns), np.nan)
    ok = closed & np.isfinite(matrix).all(axis=(1, 2))
    if ok.any():
        norms = np.linalg.norm(matrix[ok], axis=2)
        worst = np.argmax(norms, axis=1)
        rows_of = np.arange(len(worst))
        value[ok] = norms[rows_of, worst]
        pick = np.zeros((len(worst), d, columns))
        pick[rows_of, worst] = matrix[ok][rows_of, worst] / value[ok][:, None]
        left[ok] = pick.reshape(len(worst), -1)
    return Limit(name, value, most, matrix.reshape(n, left.shape[1]), left)

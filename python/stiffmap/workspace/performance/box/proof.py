"""Whether cells of positions keep all limits, inside as well as on their borders, decided by this process or the workers of a cluster; how
much of a cube does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats, thread_count
from stiffmap.common.tasks import workers
from stiffmap.workspace.performance.limits.limits import Bounds, factor_limits
from stiffmap.workspace.performance.motion.closing import kernel_starts, revolute_drives
from stiffmap.workspace.performance.motion.many_drives import corners
from stiffmap.workspace.performance.motion.velocity import singular_values

BOX = np.array(list(product((-1.0, 1.0), repeat=3)))  # (8, 3) corners of a cell, in half lengths


@dataclass(frozen=True, eq=False)
class ProvenCells:
    """What was proven of cells of positions (n)."""

    inside: NDArray[np.bool_]  # every pose of the cell closes and keeps all limits
    broken: NDArray[np.bool_]  # some pose of it does not
    where: Floats  # (n, 3) that pose, from the centre, along the cell's axes
    limit: NDArray[np.int64]  # index into `names` of the limit nearest to its bound, or beyond
    names: tuple[str, ...]
    bend: Floats  # (n, 3) share of each axis in the curvature; NaN: unknown


Judge = Callable[[Floats, Floats, Floats], ProvenCells]
"""Of cells with centres (n, 3) m, half lengths (n, 3) m along the columns of axes (3, 3)."""
PER_TASK = 500  # cells of one task on a cluster; twice as many at least, or they are decided here


def judge_cells(bounds: Bounds) -> Judge:
    """Enclosure where it can be had, else nodes."""
    return partial(sample if bounds.unproven else enclose, bounds)


@contextmanager
def judge_on(bounds: Bounds, scheduler: object = None) -> Iterator[Judge]:
    """The judge of cells; on a cluster the same cells get the same answer. Nodes are judged here: they begin at each other."""
    if scheduler is None or bounds.unproven:
        yield judge_cells(bounds)
        return
    alone = replace(bounds, threads=1, counter=[0], known=[])
    with workers(_some_cells, alone, scheduler=scheduler) as hands:

        def judge(centre: Floats, half: Floats, axes: Floats) -> ProvenCells:
            n = len(centre)
            if n < 2 * PER_TASK:
                return enclose(bounds, centre, half, axes)
            bounds.counter[0] += n
            parts = [slice(k, k + PER_TASK) for k in range(0, n, PER_TASK)]
            found: list[ProvenCells] = hands.in_order((centre[k], half[k], axes) for k in parts)
            arrays = (f.name for f in fields(ProvenCells) if f.name != "names")
            joined: Any = {n: np.concatenate([getattr(cells, n) for cells in found]) for n in arrays}
            return replace(found[0], **joined)

        yield judge


def _some_cells(bounds: Bounds, cells: tuple[Floats, Floats, Floats]) -> ProvenCells:
    """Enclosures, as a task."""
    return enclose(bounds, *cells)


SAFETY = 2.0  # on second derivatives, which are second differences between the nodes of each cell
_NODES = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
_MIDDLE = 13


def sample(bounds: Bounds, centre: Floats, half: Floats, axes: Floats) -> ProvenCells:
    """As `Bounds.over`, from nodes: an array differs from its interpolant by its second differences."""
    n = len(centre)
    local = _NODES[None] * half[:, None]
    closed, limits = bounds.at((centre[:, None] + local @ axes.T).reshape(-1, 3))
    closed = closed.reshape(n, 27)
    names = ["closure", *(limit.name for limit in limits)]
    most = [np.where(closed.all(axis=1), -np.inf, np.inf)]
    mid = [np.where(closed[:, _MIDDLE], -np.inf, np.inf)]
    bend = np.zeros((n, 3))
    for limit in limits:
        values = limit.array.reshape(n, 3, 3, 3, -1)
        nodes = limit.value.reshape(n, 27)
        size = max(abs(limit.most), 1e-9)
        error = np.zeros(n)
        for axis in range(3):
            bends = np.linalg.norm(np.diff(values, 2, axis=axis + 1), axis=-1).reshape(n, -1)
            share = bends.max(axis=1) / 8  # of the node spacing's second difference h² f''
            bend[:, axis] += share / size
            error += SAFETY * share
        with np.errstate(invalid="ignore"):
            most.append((nodes.max(axis=1) + error - limit.most) / size)
            mid.append((nodes[:, _MIDDLE] - limit.most) / size)
    table, centres = np.stack(most), np.stack(mid)
    with np.errstate(invalid="ignore"):
        broken = np.asarray(~(centres <= 0).all(axis=0))
        inside = np.asarray((table <= 0).all(axis=0))
        return ProvenCells(inside, broken, np.zeros_like(half),
                     np.argmax(np.where(np.isnan(table), np.inf, table), axis=0), tuple(names), bend)  # fmt: skip


def enclose(bounds: Bounds, centre: Floats, half: Floats, axes: Floats) -> ProvenCells:
    """Cells (n, 3) of positions, base axes, with half lengths (n, 3) along the columns of `axes`."""
    bounds.counter[0] += len(centre)
    compiled = bounds.machine.compiled
    drives = list(compiled.drives)
    wide = bounds.transmission is not None and len(drives) == 6
    watched = bounds.bars.nodes if bounds.clearance is not None else ()
    rotation = compiled.home_rotation if bounds.rotation is None else np.asarray(bounds.rotation, dtype=float)
    start = kernel_starts(bounds.machine, centre, bounds.rotation, bounds.threads)
    e = compiled.core.enclose(
        np.ascontiguousarray(centre), np.ascontiguousarray(half), axes, rotation, start=start,
        slopes=6 if wide else 3, watched=watched, threads=thread_count(bounds.threads),
    )  # fmt: skip
    ok = np.asarray(e["enclosed"])
    names, places = ["closure"], [np.zeros_like(half)]
    most, least = [np.where(ok, -np.inf, np.inf)], [np.where(e["closed"], -np.inf, np.inf)]

    def add(name: str, value: Floats, slack: Floats, bound: float, place: Floats) -> None:
        """A limit's value at its worst corner, by the linear model, and what that may miss."""
        size = max(abs(bound), 1e-9)
        names.append(name)
        with np.errstate(invalid="ignore"):
            most.append(np.where(ok, (value + slack - bound) / size, np.inf))
            least.append(np.where(ok, (value - slack - bound) / size, -np.inf))
        places.append(place)

    x = e["coordinates"]
    for index, name, sign, bound in bounds.intervals_wanted:
        slope = sign * e["slope"][:, index, :3]
        value = sign * x[:, index] + (np.abs(slope) * half).sum(axis=1)
        add(name, value, e["radius"][:, index], bound, np.where(slope < 0, -1.0, 1.0) * half)
    if bounds.clearance is not None:
        d, moved = bounds.bars.over(e["points"], e["moved"])
        add("clearance of bars", -d, moved, -bounds.clearance, np.zeros_like(half))
    if bounds.transmission is not None:
        frame = np.eye(6)
        frame[:3, :3] = axes
        turn = revolute_drives(bounds.machine)
        rows = np.where(turn, bounds.size, 1.0)[:, None]
        columns = np.concatenate([np.ones(3), np.full(3, 1 / bounds.size)])[: 6 if wide else 3]
        scale = rows * columns
        w = e["slope"][:, drives] * scale
        change = e["change"][:, :, drives] * scale
        slack = np.linalg.norm(e["slack"][:, drives] * scale, axis=(1, 2))
        for name, value, rest, bound, corner in _factors_over(
            w, change * half[:, :, None, None], slack, bounds.transmission, bounds.norm
        ):
            add(name, value, rest, bound, BOX[corner] * half)
    table, sure = np.stack(most), np.stack(least)
    table, sure = np.where(np.isnan(table), np.inf, table), np.where(np.isnan(sure), -np.inf, sure)
    broken, worst = (sure > 0).any(axis=0), np.argmax(sure, axis=0)
    limit = np.where(broken, worst, np.argmax(table, axis=0))
    where = np.stack(places)[worst, np.arange(len(centre))]
    inside = np.asarray((table <= 0).all(axis=0))
    return ProvenCells(inside, np.asarray(broken), where, limit, tuple(names), np.asarray(e["bend"]))


def _factors_over(
    w: Floats, step: Floats, slack: Floats, transmission: tuple[float, float], factors: str
) -> list[tuple[str, Floats, Floats, float, NDArray[np.int64]]]:
    """Name, value at the worst corner by the linear model, what it may miss, bound and number of that corner,
    from W = J^-1 (n, d, d), its change to the cell's faces (n, 3, d, d), the Frobenius norm of the rest (n,)."""
    low, high = transmission
    n, d = len(w), w.shape[-1]
    sphere, (below, above) = factors == "sphere", factor_limits(factors, transmission)
    out = []

    def add(name: str, ok: NDArray[np.bool_], values: Floats, rest: Floats, bound: float) -> None:
        """Of the cells that are `ok`: values (k, 8) at the corners."""
        value, miss, corner = np.full(n, np.nan), np.full(n, np.inf), np.zeros(n, dtype=np.int64)
        value[ok], miss[ok], corner[ok] = values.max(axis=1), rest, values.argmax(axis=1)
        out.append((name, value, miss, bound, corner))

    ok = np.isfinite(w).all(axis=(1, 2)) & np.isfinite(slack)
    if low > 0:
        at = w[ok][:, None] + np.einsum("ck,nkab->ncab", BOX, step[ok])
        values = singular_values(at)[..., 0] if sphere else np.linalg.norm(at, axis=3).max(axis=2)
        add(below, ok, values, slack[ok], 1 / low)
    if not np.isfinite(high):
        return out
    ok = ok & (np.abs(np.linalg.det(np.where(ok[:, None, None], w, np.eye(d)))) > 1e-12)
    v = np.linalg.inv(w[ok])
    relative = v[:, None] @ step[ok]
    size = singular_values(v)[..., 0]
    # J = (1 + Z)^-1 V with Z = V (step + rest): its part of first order is exact, the others are bounded
    z = singular_values(np.einsum("ck,nkab->ncab", BOX, relative))[..., 0].max(axis=1) + size * slack[ok]
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.where(z < 1, (z**2 / (1 - z) + size * slack[ok]) * size, np.inf)
    at = v[:, None] - np.einsum("ck,nkab->ncab", BOX, relative @ v[:, None])
    if sphere:
        values = singular_values(at)[..., 0]
    else:
        values, rest = np.linalg.norm(at @ corners(d).T, axis=2).max(axis=2), rest * np.sqrt(d)
    add(above, ok, values, rest, high)
    return out


FIRST = 4  # cells along each edge at first
HALVED = 0.5  # axes with this share of the largest curvature, or more, are halved too


@dataclass(frozen=True, eq=False)
class Shrunk:
    """The largest cube about a centre, up to the one asked for, that was decided to keep all limits."""

    edge: float
    broken: Floats  # (k, 3) positions that break a limit, in the cube's own coordinates
    names: tuple[str, ...]  # limits that stopped it, or that came nearest to
    cells: int


def shrink(
    judge: Judge, axes: Floats, shape: Floats, centre: Floats, edge: float, least: float, gap: float, work: int
) -> Shrunk:  # fmt: skip
    """Cells are halved until decided; an undecided one of a size near `gap`, or a point that breaks a
    limit, shrinks the cube about its centre instead. Coordinates along `axes`, divided by `shape`.

    Gives up (edge 0) below `least`, or when more than `work` cells were asked for.
    """
    step = np.arange(FIRST) / FIRST
    low = np.stack(np.meshgrid(step, step, step, indexing="ij"), axis=-1).reshape(-1, 3)
    low = centre - edge / 2 + edge * low
    high = low + edge / FIRST
    broken = [np.zeros((0, 3))]
    names: dict[str, int] = {}
    last, count, back = "", 0, 0.1 * gap
    while len(low):
        if count + len(low) > work or edge <= least:
            return Shrunk(0.0, np.concatenate(broken), tuple(names) or (last,), count)
        middle, half = (low + high) / 2, (high - low) / 2
        found = judge((middle * shape) @ axes.T, half * shape, axes)
        count += len(low)
        outside = found.broken
        if outside.any():
            points = (middle + found.where / shape)[outside]
            broken.append(points)
            for i in np.unique(found.limit[outside]):
                names[found.names[i]] = 1
            edge = min(edge, 2 * float(np.abs(points - centre).max(axis=1).min()) - back)
            back *= 3  # a face that sticks out is left in few steps
        left = ~found.inside
        last = found.names[int(found.limit[left][0])] if left.any() else last
        low, high, bend = low[left], high[left], found.bend[left]
        size = (high - low).max(axis=1) if len(low) else np.zeros(0)
        tiny = size < 0.05 * gap
        if tiny.any():
            near = np.maximum(np.maximum(low - centre, centre - high).max(axis=1), 0.0)[tiny]
            edge = min(edge, 2 * float(near.min()))
            names[last] = 1
        low, high = np.maximum(low, centre - edge / 2), np.minimum(high, centre + edge / 2)
        kept = (high - low > 1e-15).all(axis=1)
        low, high = halved(low[kept], high[kept], bend[kept])
    return Shrunk(edge, np.concatenate(broken), tuple(names) or ((last,) if last else ()), count)


def halved(low: Floats, high: Floats, bend: Floats) -> tuple[Floats, Floats]:
    """Each cell cut in two along the axes that curve most; along the longest where that is not known."""
    size = high - low
    longest = np.maximum(size.max(axis=1, keepdims=True), 1e-300)
    weight = np.where(np.isfinite(bend).all(axis=1, keepdims=True), bend * size / longest, size)
    # an axis along which nothing curves is cut as well when it is far longer than the others
    weight = weight + 1e-3 * size / longest * weight.max(axis=1, keepdims=True)
    weight = np.where(weight.max(axis=1, keepdims=True) > 0, weight, size)
    cut: NDArray[np.bool_] = np.greater_equal(weight, HALVED * weight.max(axis=1, keepdims=True))
    for axis in range(3):
        chosen, n = np.flatnonzero(cut[:, axis]), len(low)
        middle = (low[chosen, axis] + high[chosen, axis]) / 2
        low, high = (np.concatenate([a, a[chosen]]) for a in (low, high))
        cut = np.concatenate([cut, cut[chosen]])
        high[chosen, axis] = low[n:, axis] = middle
    return low, high

"""What balances a walk: the wrenches of its loops, which nobody knows, and the forces of laws that are not one number.

As many rows of the balance as there are unknowns give the wrenches, and all the others test them: wrenches that balance
everything prove that something does. Only where they do not is the least residual sought."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr
from scipy.optimize import lsq_linear

if TYPE_CHECKING:
    from .statics import Frame, Walk

Array = np.ndarray
BALANCED = 1e-9
"""Residual, of the largest force, below which it is not made smaller."""
ENOUGH = 1e-8
"""The same for wrenches from as many rows as unknowns."""


@dataclass(frozen=True)
class Balancing:
    """Of n poses, m coordinates, L loops."""

    screws: Array
    """(n, m, 6) motion of the body behind each coordinate, linear part at the base's origin; angles over the size."""
    rows: Array
    """Numbers of the coordinates whose force is known."""
    loops: list[tuple[Frame, Frame]]
    size: float
    given: Array
    """(n, m) N: of known wrenches."""
    needed: Array
    """(n, m) N: of laws and springs; a first guess where there is a choice."""
    allowed: dict[int, tuple[Array, Array]]
    """Coordinate -> (n, k) lower and upper ends of what its law allows, N."""

    def of(self, at: Array) -> Balancing:
        """Some of the poses."""
        loops = [(a.of(at), b.of(at)) for a, b in self.loops]
        allowed = {i: (low[at], high[at]) for i, (low, high) in self.allowed.items()}
        return Balancing(
            self.screws[at], self.rows, loops, self.size, self.given[at], self.needed[at], allowed
        )

    def columns(self, rows: Array) -> Array:
        """(n, rows, 6 L): work of the unit wrenches of the loops, forces and moments over the size."""
        n = len(self.screws)
        where = np.full(self.screws.shape[1], -1)
        where[rows] = np.arange(len(rows))
        out = np.zeros((n, len(rows), 6 * len(self.loops)))
        for k, (first, other) in enumerate(self.loops):
            for f, sign in ((other, 1.0), (first, -1.0)):
                before = np.array([i for i in f.before if where[i] >= 0], dtype=int)
                s, to = self.screws[:, before], where[before]
                out[:, to, 6 * k : 6 * k + 3] += sign * (s[..., :3] + cross(s[..., 3:], first.p[:, None]))
                out[:, to, 6 * k + 3 : 6 * k + 6] += (sign * self.size) * s[..., 3:]
        return out

    def held(self, reaction: Array) -> Array:
        """(n, m): work of wrenches (n, 6 L) on every coordinate."""
        out = np.zeros(self.screws.shape[:2])
        for k, (first, other) in enumerate(self.loops):
            force = reaction[:, 6 * k : 6 * k + 3]
            moment = self.size * reaction[:, 6 * k + 3 : 6 * k + 6] + cross(first.p, force)
            both = np.concatenate([force, moment], 1)[:, :, None]
            for f, sign in ((other, 1.0), (first, -1.0)):
                before = list(f.before)
                out[:, before] += sign * (self.screws[:, before] @ both)[..., 0]
        return out


def cross(a: Array, b: Array) -> Array:
    """Of vectors along the last axis, a third of the time of numpy's."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out


def balancing(walk: Walk, size: float) -> Balancing:
    n, m = len(walk.case.force), len(walk.axes)
    screws = np.zeros((n, m, 6))
    revolute = np.array([a.revolute for a in walk.axes], dtype=bool)
    weight = np.where(revolute, 1.0 / size, 1.0)
    if m:
        axes, points = (np.stack([getattr(a, v) for a in walk.axes], 1) for v in ("axis", "point"))
        screws[..., :3] = np.where(revolute[:, None], cross(points, axes), axes) * weight[:, None]
        screws[:, revolute, 3:] = axes[:, revolute] / size
    needed, allowed = np.zeros((n, m)), {}
    for i, a in enumerate(walk.axes):
        if a.force is not None:
            needed[:, i] = a.force * weight[i]
        if a.allowed is not None:
            allowed[i] = (a.allowed[0] * weight[i], a.allowed[1] * weight[i])
            needed[:, i] = nearest(allowed[i], needed[:, i])
    given = np.zeros((n, m))
    for f, at, force, moment in walk.known:
        before = list(f.before)
        if before:
            both = np.concatenate([force, moment + cross(at, force)], 1)[:, :, None]
            given[:, before] += (screws[:, before] @ both)[..., 0]
    rows = np.array([i for i, a in enumerate(walk.axes) if a.force is not None], dtype=int)
    return Balancing(screws, rows, walk.loops, size, given, needed, allowed)


def unbalanced(walk: Walk, size: float) -> tuple[Array, Array]:
    """Residual and scale (n,) N."""
    b = balancing(walk, size)
    worst, reaction = quick(b)
    scale = np.maximum(np.abs(b.needed).max(1, initial=0.0), np.abs(b.given).max(1, initial=0.0))
    scale = np.maximum(scale, np.abs(reaction).max(1, initial=0.0))
    todo = np.flatnonzero(~(worst <= ENOUGH * scale))
    if len(todo):
        worst[todo], reaction[todo] = careful(b.of(todo))
    return worst, np.maximum(scale, np.abs(reaction).max(1, initial=0.0))


def quick(b: Balancing) -> tuple[Array, Array]:
    """Wrenches of the loops from as many rows as they have freedoms."""
    n, unknown = len(b.screws), 6 * len(b.loops)
    reaction, missing = np.zeros((n, unknown)), b.needed - b.given
    if unknown and n:
        sample = b.of(np.array([n // 2])).columns(b.rows)[0]
        _, r, order = qr(sample, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(r))
        use = np.sort(order[: int((diagonal > 1e-6 * diagonal.max(initial=0.0)).sum())])
        best = qr(sample[:, use].T, mode="r", pivoting=True)[1]
        rows = b.rows[np.sort(best[: len(use)])]
        try:
            square = b.columns(rows)[:, :, use]
            reaction[:, use] = np.linalg.solve(square, missing[:, rows, None])[..., 0]
        except np.linalg.LinAlgError:
            return np.full(n, np.inf), reaction
    off = np.abs(b.held(reaction) - missing)[:, b.rows].max(1, initial=0.0)
    return off, reaction


def careful(b: Balancing) -> tuple[Array, Array]:
    """The least residual, over all that laws allow."""
    left = b.columns(b.rows)
    worst, reaction = settle(b, left, b.needed)
    if b.allowed:  # what rubs where its way is second order: from the middle too
        other = b.needed.copy()
        for i, (low, high) in b.allowed.items():
            middle = low.shape[1] // 2
            other[:, i] = (low[:, middle] + high[:, middle]) / 2
        again, pull = settle(b, left, other)
        better = again < worst
        worst, reaction = np.where(better, again, worst), np.where(better[:, None], pull, reaction)
        for j in np.flatnonzero(worst > 1e-8 * np.abs(reaction).max(1, initial=0.0)):
            worst[j] = min(worst[j], bounded(b, left[j], int(j)))
    return worst, reaction


def settle(b: Balancing, left: Array, needed: Array) -> tuple[Array, Array]:
    """Residual (n,) and reactions of the loops: between what the loops can give and what the laws allow, in turns."""
    n = len(b.given)
    worst, reaction, todo = np.full(n, np.inf), np.zeros((n, left.shape[2])), np.arange(n)
    inverse, needed = pseudo_inverse(left), needed.copy()
    for _ in range(60 if b.allowed else 1):
        missing = needed[todo] - b.given[todo]
        reaction[todo] = np.einsum("nij,nj->ni", inverse[todo], missing[:, b.rows])
        held = b.of(todo).held(reaction[todo])
        off = np.abs(held - missing)[:, b.rows].max(1, initial=0.0)
        worst[todo] = np.minimum(worst[todo], off)
        before, after = needed[todo], needed[todo].copy()
        for i, (low, high) in b.allowed.items():
            after[:, i] = nearest((low[todo], high[todo]), b.given[todo, i] + held[:, i])
        needed[todo] = after
        largest = np.maximum(
            np.abs(b.given[todo]).max(1, initial=0.0), np.abs(reaction[todo]).max(1, initial=0.0)
        )
        todo = todo[(after != before).any(1) & (worst[todo] > BALANCED * largest)]
        if not len(todo):
            break
    return worst, reaction


def bounded(b: Balancing, left: Array, j: int) -> float:
    """Residual of one pose by bounded least squares over the reactions and the forces inside steps of laws."""
    ends = {i: (low[j, 0], high[j, 0]) for i, (low, high) in b.allowed.items() if low[j, 0] < high[j, 0]}
    inside = [i for i in b.rows if i in ends]
    if not inside:
        return np.inf
    unit = np.zeros((b.screws.shape[1], len(inside)))
    unit[inside, range(len(inside))] = -1.0
    missing = np.where(np.isin(np.arange(len(unit)), inside), 0.0, b.needed[j]) - b.given[j]
    free = [(-np.inf, np.inf)] * left.shape[1]
    low, high = np.transpose(np.array([*free, *(ends[i] for i in inside)]))
    a = np.hstack([left, unit[b.rows]])
    return float(np.abs(a @ lsq_linear(a, missing[b.rows], (low, high), tol=1e-15).x - missing[b.rows]).max())


def open_ways(walk: Walk) -> Array:
    """(n,) bool: a law that rubs one way or the other."""
    out = np.zeros(len(walk.case.force), dtype=bool)
    for a in walk.axes:
        if a.allowed is not None:
            out |= (a.allowed[0] == a.allowed[1]).all(1) & (np.ptp(a.allowed[0], axis=1) > 0)
    return out


def nearest(allowed: tuple[Array, Array], force: Array) -> Array:
    """Of the intervals (n, k) that a law allows, the force that lies nearest."""
    choice = np.clip(force[:, None], *allowed)
    if choice.shape[1] == 1:
        return np.asarray(choice[:, 0])
    best = np.abs(choice - force[:, None]).argmin(1)
    return np.asarray(choice[np.arange(len(force)), best])


def pseudo_inverse(a: Array) -> Array:
    """(n, columns, rows) that gives the solution of least squares, of least norm where columns depend on each other."""
    if a.shape[2] == 0:
        return np.zeros((len(a), 0, a.shape[1]))
    q, r = np.linalg.qr(a)
    diagonal = np.abs(np.einsum("nii->ni", r))
    sound = diagonal.min(1) > 1e-8 * diagonal.max(1)
    out = np.empty((len(a), a.shape[2], a.shape[1]))
    if sound.any():
        out[sound] = np.linalg.solve(r[sound], np.swapaxes(q[sound], 1, 2))
    if not sound.all():
        out[~sound] = np.linalg.pinv(a[~sound], rcond=1e-9)
    return out

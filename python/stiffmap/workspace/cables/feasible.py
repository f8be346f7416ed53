"""Boxes of positions in which tensions within their limits hold every wrench of a set: proven, not sampled.

At the centre of a cell tensions are found for each extreme wrench. Over the cell the direction of a straight piece of
length s turns by at most d/(s - d) within a distance d, so that the structure matrix changes by a bounded dW; the
tensions then need a correction of at most |dW t| / (sigma - |dW|), sigma the least singular value at the centre. Where
that is within the room that they have, the whole cell is feasible; where a multiplier separates the wrench from all
tensions by more than dW can bring, none of it is. What is neither is halved (docs/theory.md B6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.closing import commanded
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.cables.structure import (
    Hanging,
    hanging,
    limits,
    lines,
    matrix,
    nearest,
    scaled,
    weight,
)
from stiffmap.workspace.maps.inputs import read_box

ROOMY = 1e4  # N: room above the lowest tension where no highest is declared


@dataclass(frozen=True, eq=False)
class WrenchFeasible:
    """Cells (n, 2, 3) m: lowest and highest corners."""

    inside: Floats
    """Every position of them holds every wrench."""
    outside: Floats
    """No position of them holds all."""
    open: Floats
    """Smaller than the resolution, not decided."""

    @property
    def share(self) -> tuple[float, float, float]:
        """Of the volume: inside, outside, open."""
        every = np.concatenate([self.inside, self.outside, self.open])
        edges = np.ptp(every, axis=(0, 1)) > 0  # those of the box that have a length
        sizes = [
            float(np.prod((c[:, 1] - c[:, 0])[:, edges], axis=1).sum())
            for c in (self.inside, self.outside, self.open)
        ]
        return sizes[0] / sum(sizes), sizes[1] / sum(sizes), sizes[2] / sum(sizes)


@takes_machine
def wrench_feasible(
    machine: Machine,
    wrenches: ArrayLike | None = None,
    *,
    box: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike | None = None,
    gap: float = 0.05,
) -> WrenchFeasible:
    """Where in a box of tcp positions the cables hold all of a set of wrenches besides the platform's weight.

    wrenches
        (k, 6) N, N·m at the tcp, base axes: the corners of the set; None: no wrench.
    box
        (2, 3) m; None: the machine's workspace. Edges without length stay so.
    rotation, gravity, lowest, highest
        As `tension_distribution`; one rotation. Machines with legs or external springs are refused.
    gap
        Cells are halved down to this share of the box's longest edge.
    """
    h = hanging(machine)
    if h.springs:
        raise StiffmapError(f"{machine.name}: expected no external springs, got {h.springs[0][0].name}")
    low, high = read_box(machine, box)
    r = commanded(machine.compiled, low, rotation)[1]
    w = np.atleast_2d(wrench_array(wrenches)) + weight(h, low, r, machine.compiled.gravity(gravity))
    bounds = limits(h, lowest, highest)
    least = gap * float((high - low).max())
    cells = np.stack([low, high])[None]
    found: tuple[list[Floats], list[Floats], list[Floats]] = ([], [], [])
    while len(cells):
        inside, outside = _judged(h, r, w, *bounds, cells)
        open_ = cells[~inside & ~outside]
        small = (open_[:, 1] - open_[:, 0]).max(axis=1) <= least
        for kept, some in zip(found, (cells[inside], cells[outside], open_[small]), strict=True):
            kept.append(some)
        cells = halves(open_[~small])
    return WrenchFeasible(*(np.concatenate(k) for k in found))


def halves(cells: Floats) -> Floats:
    """Each cell cut across its longest edge."""
    axis = np.argmax(cells[:, 1] - cells[:, 0], axis=1)
    one, other = cells.copy(), cells.copy()
    n = np.arange(len(cells))
    middle = cells.mean(axis=1)[n, axis]
    one[n, 1, axis] = middle
    other[n, 0, axis] = middle
    return np.concatenate([one, other])


def turned(straight: Floats, reach: Floats) -> Floats:
    """Bound of how far the unit vector along a line of this length moves where its end moves by `reach`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(straight > reach, reach / (straight - reach), np.inf)


def changed(h: Hanging, straight: Floats, arm: Floats, reach: Floats) -> Floats:
    """(..., n) bound of how far each column of `scaled` moves where the platform moves by `reach`; lengths, arms as by `lines`."""
    return np.asarray(turned(straight, reach) * np.sqrt(1.0 + (arm**2).sum(-1) / h.length**2))


def _judged(
    h: Hanging, rotation: Floats, wrenches: Floats, low: Floats, high: Floats, cells: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which cells (n, 2, 3) hold every wrench everywhere, and which nowhere all of them."""
    centre = cells.mean(axis=1)
    reach = 0.5 * np.linalg.norm(cells[:, 1] - cells[:, 0], axis=1)
    unit, straight, arm = lines(h, centre, rotation)
    plain = matrix(unit, straight, arm)
    column = changed(h, straight, arm, reach[:, None])
    inside, outside = np.ones(len(cells), dtype=bool), np.zeros(len(cells), dtype=bool)
    top = np.where(np.isfinite(high), high, low + ROOMY)
    for wrench in wrenches:
        a, b = scaled(h, plain, -np.broadcast_to(wrench, (len(cells), 6)))
        t, ok, v = nearest(a, b, low, top, 0.5 * (low + top))
        room = np.minimum(t - low, top - t).min(axis=1)
        sigma = np.linalg.svd(a, compute_uv=False)[:, len(h.rows) - 1] if a.shape[2] >= a.shape[1] else 0.0
        with np.errstate(invalid="ignore"):
            rest = sigma - np.linalg.norm(column, axis=1)
            correction = np.where(rest > 0, (column * t).sum(axis=1) / np.maximum(rest, 1e-300), np.inf)
            inside &= ok & (correction <= room)
        # A direction that no tensions reach: b is farther along it than any of them.
        y = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300)
        along = np.einsum("mrn,mr->mn", a, y)
        with np.errstate(invalid="ignore"):
            best = np.where(along > 0, along * high, along * low)
            best = np.where(along == 0, 0.0, best).sum(axis=1)
            more = (column * np.where(np.isfinite(high), high, np.inf)).sum(axis=1)
            outside |= ~ok & ((y * b).sum(axis=1) > best + more)
    return inside, outside

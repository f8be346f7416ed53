"""Largest box similar to a given one inside the workspace, equation (3) of the paper (theory D8, D9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from scipy.spatial import cKDTree

from stiffmap.broadcasting import Floats
from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine, takes_machine
from stiffmap.performance.cells import prove
from stiffmap.performance.limits import Bounds
from stiffmap.rotations import as_rotations

SAMPLES = 13
"""Nodes along each edge of the region where witnesses are looked for first."""
ROUNDS = 60
STEP = 2e-3
"""Spacing of the differences that give slopes and bends at a corner, times the region's size."""
SIGNS = np.array([(a, b, c) for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)])

CROSS = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
PAIRS = ((0, 1), (0, 2), (1, 2))
CURVED = np.concatenate([CROSS, *([np.eye(3)[a] + np.eye(3)[b]] * np.array([[1], [-1]]) for a, b in PAIRS)])
MARGIN = 0.25
"""Share of the largest second derivative added for what changes of it within a cell."""


@dataclass(frozen=True, eq=False)
class LargestBox:
    """Bounds on the largest similar box, and where it is."""

    edge: float
    """m, first edge of a box that is proven to lie inside the workspace: the lower bound."""
    edge_upper: float
    """m, no box of this first edge or more fits (within the region searched)."""
    edges: Floats
    """(3,) m of the proven box."""
    centre: Floats
    """(3,) m, base axes."""
    orientation: Floats
    """(3, 3) axes of the box in base axes."""
    limited_by: tuple[str, ...]
    """What would break first."""
    region: Floats
    """(2, 3) m, where boxes were looked for, in the box's own axes about the base origin."""
    proven: bool
    """False: no box at all was proven (edge 0)."""
    poses: int
    """Poses that were closed for it."""

    @property
    def gap(self) -> float:
        """m between the bounds."""
        return self.edge_upper - self.edge

    @property
    def corners(self) -> Floats:
        """(2, 3) m, lowest and highest corner in the box's axes."""
        local = self.orientation.T @ self.centre
        return np.stack([local - self.edges / 2, local + self.edges / 2])


@takes_machine
def largest_box(
    machine: Machine,
    proportions: ArrayLike = (1.0, 1.0, 1.0),
    *,
    transmission: tuple[float, float] | None = (0.5, 2.0),
    length: float | None = None,
    ranges: bool = True,
    joints: bool = True,
    rotation: ArrayLike | None = None,
    orientation: ArrayLike | None = None,
    region: ArrayLike | None = None,
    gap: float = 1e-4,
    threads: int | None = None,
) -> LargestBox:
    """Largest box of given proportions, anywhere in the workspace, all of it within the limits.

    Parameters
    ----------
    proportions
        (3,) edges relative to each other, (1, 1, 1) for a cube.
    transmission
        Bounds on the singular values of the (weighted) Jacobian; None: not asked for.
    length
        Characteristic length, as in `velocity_transmission`.
    ranges, joints
        Whether ranges of drives and limits of passive joints count.
    rotation
        (3, 3) commanded orientation of the platform; None: as at home.
    orientation
        (3, 3) axes of the box in base axes; None: base axes.
    region
        (2, 3) m, where to look (in the box's axes); None: the machine's workspace, three times as large.
    gap
        m: search goes on until upper and lower bound are this near.

    The lower bound is a box whose inside is proven between nodes, the upper one a proof by violated
    points and linear estimates of the limits there, both with second derivatives from differences and
    a safety factor of 2 (docs/measures.md says what that does and does not guarantee).
    Raises StiffmapError for bad input.
    """
    shape = np.asarray(proportions, dtype=float)
    if shape.shape != (3,) or not (np.isfinite(shape).all() and (shape > 0).all()):
        raise StiffmapError(f"proportions: expected 3 positive numbers, got {proportions!r}")
    if not gap > 0:
        raise StiffmapError(f"gap: expected a positive length in m, got {gap!r}")
    axes = np.eye(3) if orientation is None else np.asarray(orientation, dtype=float)
    axes = as_rotations(axes)
    bounds = Bounds(
        machine, None if rotation is None else np.asarray(rotation, dtype=float), transmission,
        "sphere", length, ranges, joints, threads,
    )  # fmt: skip
    return _Search(bounds, shape / shape[0], axes, _region(machine, region, axes), gap).run()


def _region(machine: Machine, region: ArrayLike | None, axes: Floats) -> Floats:
    if region is not None:
        out = np.asarray(region, dtype=float)
        if out.shape != (2, 3) or not (np.isfinite(out).all() and (out[1] > out[0]).all()):
            raise StiffmapError(f"region: expected lowest and highest corner (2, 3) in m, got {region!r}")
        return out
    low, high = machine.workspace
    centre, half = axes.T @ ((low + high) / 2), np.abs(axes.T) @ (high - low) / 2
    return np.stack([centre - 3 * half, centre + 3 * half])


def _hollow(value: Floats, step: float) -> float:
    """Bound on minus the second derivative of a limit's lower estimate, from its values at `CURVED`."""
    bend = np.diag(value[1:4] - 2 * value[0] + value[4:7])
    for i, (a, b) in enumerate(PAIRS):
        both = value[7 + 2 * i] + value[8 + 2 * i] - 2 * value[0]
        bend[a, b] = bend[b, a] = (both - bend[a, a] - bend[b, b]) / 2
    least, *_, most = np.linalg.eigvalsh(bend) / step**2
    return float(max(0.0, -least) + MARGIN * max(abs(least), abs(most)))


class _Search:
    """Works in coordinates of the box's axes divided by its proportions: boxes are then cubes."""

    def __init__(self, bounds: Bounds, shape: Floats, axes: Floats, region: Floats, gap: float) -> None:
        self.shape, self.axes, self.region, self.gap = shape, axes, region, gap
        self.low, self.high = region / shape
        self.size = float((self.high - self.low).max())
        self.bounds = bounds
        self.best, self.centre, self.names = 0.0, (self.low + self.high) / 2, set[str]()
        self.witnesses = np.zeros((0, 3))

    def base(self, local: Floats) -> Floats:
        return np.asarray((local * self.shape) @ self.axes.T)

    def run(self) -> LargestBox:
        self._sample()
        self._climb()
        upper = self._cover()
        first = self.best
        return LargestBox(
            edge=first, edge_upper=max(upper, first), edges=first * self.shape,
            centre=self.base(self.centre), orientation=self.axes, limited_by=tuple(sorted(self.names)),
            region=self.region, proven=first > 0, poses=self.bounds.counter[0],
        )  # fmt: skip

    def _inside(self, local: Floats) -> NDArray[np.bool_]:
        closed, limits = self.bounds.at(self.base(local))
        good = closed.copy()
        for limit in limits:
            good &= limit.value <= limit.most
        return good

    def _sample(self) -> None:
        """Nodes of a grid that break a limit, pulled to the workspace's border along the grid's lines."""
        axes = [np.linspace(a, b, SAMPLES) for a, b in zip(self.low, self.high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        good: NDArray[np.bool_] = self._inside(grid.reshape(-1, 3)).reshape(grid.shape[:3])
        self.good = grid[good]
        pairs = []
        for axis in range(3):
            a, b = np.moveaxis(grid, axis, 0), np.moveaxis(good, axis, 0)
            for here, there in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
                change = b[here] & ~b[there]
                pairs.append((a[here][change], a[there][change]))
        inside, outside = (np.concatenate([p[i] for p in pairs]) for i in (0, 1))
        self.witnesses = np.concatenate([grid[~good], self._pull(inside, outside, 8)])

    def _pull(self, inside: Floats, outside: Floats, steps: int) -> Floats:
        """Broken points on the way to points that hold, as near to those as bisection comes."""
        for _ in range(steps):
            middle = (inside + outside) / 2
            good = self._inside(middle)[:, None]
            inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
        return outside

    def _room(self, tree: cKDTree, centres: Floats) -> Floats:
        """Edge of the cube about each centre that touches the nearest witness or the region's border."""
        near = tree.query(centres, p=np.inf)[0] if len(self.witnesses) else np.inf
        border = np.minimum(centres - self.low, self.high - centres).min(axis=1)
        return np.asarray(2 * np.minimum(near, border))

    def _climb(self) -> None:
        """From the roomiest node: linear programs over the limits at the corners, then the proof."""
        if not len(self.good):
            return
        tree = cKDTree(self.witnesses) if len(self.witnesses) else cKDTree(np.full((1, 3), 1e9))
        room = self._room(tree, self.good)
        starts = self.good[np.argsort(-room)[:3]]
        for start, edge in zip(starts, np.sort(room)[::-1][:3], strict=False):
            self._ascend(start, edge)

    def _ascend(self, centre: Floats, edge: float) -> None:
        trust, edge = 0.1 * self.size, 0.9 * float(edge)
        while edge > self.gap and not self._inside(centre + SIGNS * edge / 2).all():
            edge *= 0.8  # a limit between the witnesses
        for _ in range(ROUNDS):
            better = self._program(centre, edge, trust, curved=False)
            if better is None or better[1] <= edge + 0.1 * self.gap:
                trust *= 0.25
                if trust < 0.1 * self.gap:
                    break
                continue
            if self._inside(better[0] + SIGNS * better[1] / 2).all():
                centre, edge = better
            else:
                trust *= 0.5
        edge -= 0.3 * self.gap
        for _ in range(30):
            if edge <= self.best:
                return
            proof = prove(self.bounds_in_box(), centre - edge / 2, centre + edge / 2)
            self.names.update([proof.limit] if proof.limit else [])
            if proof.holds:
                self.best, self.centre = edge, centre
                self.names = {proof.limit}
                return
            if len(proof.broken):
                outside = np.asarray(proof.broken @ self.axes) / self.shape
                self.witnesses = np.concatenate([self.witnesses, outside])
                edge = min(
                    edge - 0.3 * self.gap,
                    2 * float(np.abs(outside - centre).max(axis=1).min()) - 0.2 * self.gap,
                )
            else:
                edge -= max(0.3 * self.gap, 0.02 * edge)

    def bounds_in_box(self) -> Bounds:
        return _Turned(self.bounds, self)  # type: ignore[return-value]

    def _program(
        self, centre: Floats, edge: float, reach: float, *, curved: bool
    ) -> tuple[Floats, float] | None:
        """Best cube with its centre within `reach`, limits at the corners linear (`curved`: lower
        estimates less the bend, so that the answer bounds every cube there)."""
        corners = centre + SIGNS * edge / 2
        rows, room = [], []
        step = STEP * self.size
        stencil = step * (CURVED if curved else CROSS)
        closed, limits = self.bounds.at(self.base((corners[:, None] + stencil).reshape(-1, 3)))
        closed = closed.reshape(8, -1)
        for limit in limits:
            arrays = limit.array.reshape(8, len(stencil), -1)
            left = limit.left.reshape(8, len(stencil), -1)[:, 0]
            for c in range(8):
                if not closed[c].all():
                    continue
                value = arrays[c] @ left[c]
                slope = (value[1:4] - value[4:7]) / (2 * step)
                # value + slope·d + d·bend·d / 2 <= most, with d = shift + sign * growth / 2
                slack = _hollow(value, step) / 2 * 3 * (1.5 * reach) ** 2 if curved else 0.0
                rows.append([*slope, slope @ SIGNS[c] / 2])
                room.append(limit.most - value[0] + slack)
        if not rows:
            return None
        inside = [
            (max(-reach, lo), min(reach, hi))
            for lo, hi in zip(self.low - centre, self.high - centre, strict=True)
        ]
        for axis in range(3):  # stays in the region
            for sign in (1.0, -1.0):
                row = np.zeros(4)
                row[axis], row[3] = sign, 0.5
                rows.append(list(row))
                room.append(
                    (self.high - centre)[axis] - edge / 2
                    if sign > 0
                    else (centre - self.low)[axis] - edge / 2
                )
        answer = linprog(
            [0, 0, 0, -1], A_ub=np.array(rows), b_ub=np.array(room), bounds=[*inside, (-edge, reach)]
        )
        if answer.status != 0:
            return None
        return centre + answer.x[:3], edge + float(answer.x[3])

    def _cover(self) -> float:
        """Upper bound: every centre is excluded by a witness, or by a linear program over its cell."""
        tree = cKDTree(self.witnesses) if len(self.witnesses) else cKDTree(np.full((1, 3), 1e9))
        count = 8
        half = self.size / count / 2
        axes = [np.arange(a + half, b + half, 2 * half) for a, b in zip(self.low, self.high, strict=True)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        target = self.best + self.gap
        upper = self.best
        for _ in range(40):
            top = self._room(tree, cells) + 2 * half
            cells, top = cells[top > target], top[top > target]
            if not len(cells):
                break
            if half < 0.02 * self.size:
                keep = np.ones(len(cells), dtype=bool)
                for i, centre in enumerate(cells):
                    found = self._program(centre, self.best, half, curved=True)
                    # a growth beyond the reach was not looked at
                    if found is not None and found[1] < self.best + half:
                        top[i] = min(top[i], found[1])
                    keep[i] = top[i] > target
                cells, top = cells[keep], top[keep]
                if not len(cells):
                    break
            if half < 0.25 * self.gap or len(cells) > 4000:
                return float(max(upper, top.max()))
            half /= 2
            cells = (cells[:, None] + half * SIGNS).reshape(-1, 3)
        return max(upper, target)


@dataclass(frozen=True)
class _Turned:
    """The limits, asked in a search's own coordinates."""

    bounds: Bounds
    search: _Search

    def at(self, position: Floats):  # type: ignore[no-untyped-def]
        return self.bounds.at(self.search.base(position))

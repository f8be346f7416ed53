"""Search for the largest cube in the workspace: a lower bound that was proven, an upper one that excludes."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial import cKDTree

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.maps.inputs import box_nodes
from stiffmap.workspace.performance.box.inside import REACH
from stiffmap.workspace.performance.box.proof import BOX, Judge, judge_cells, shrink
from stiffmap.workspace.performance.limits.limits import Bounds

SAMPLES = 9  # nodes along each edge of the region where poses that break a limit are looked for first
ROUNDS = 60
STEP = 2e-3  # spacing of the differences that give slopes at a corner, times the region's size
AGAIN = 8  # most times that the cube moves away from poses that the proof found broken
SETTLED = 8
"""Most times that a climbed cube is climbed again because a limit is broken on its surface, between its corners."""
LESS = 1e-3
"""A third of what is taken off a cube whose proof took too many cells; three times as much each time."""
CROSS = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
FACES = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
NEAR = 0.05  # of half the edge: points that are nearer to each other count as one
SURFACE = np.array([v for v in product(np.linspace(-1, 1, 25), repeat=3) if np.abs(v).max() == 1])
MOST_CELLS = 8000
TRIED = 24


class BoxSearch:
    """Works in coordinates of the box's axes divided by its proportions: boxes are then cubes."""

    def __init__(
        self, bounds: Bounds, shape: Floats, axes: Floats, region: Floats, gap: float, work: int, judge: Judge | None = None
    ) -> None:  # fmt: skip
        self.shape, self.axes, self.gap, self.work = shape, axes, gap, work
        self.low, self.high = region / shape
        self.size = float((self.high - self.low).max())
        self.bounds, self.judge = bounds, judge or judge_cells(bounds)
        self.best, self.centre = 0.0, (self.low + self.high) / 2
        self.names: tuple[str, ...] = ()
        self.witnesses = np.zeros((0, 3))
        self.touched = BOX
        """Points of the cube, -1 to 1, at which limits are watched while it climbs."""
        self.exhausted = False
        """Whether the work allowed was used up."""
        self.climbing = 0
        """Poses closed while climbing, which are bounded of themselves and do not count as work."""

    def run(self) -> float:
        """Lower bound (`best`, about `centre`), then the upper bound, which is returned."""
        climbed = [self.climb(start, edge) for start, edge in self.starts(3)]
        for centre, edge in sorted(climbed, key=lambda c: -c[1]):
            if edge > self.best + 0.5 * self.gap:
                self._prove(*self.settle(centre, edge))
        return max(self._cover(), self.best)

    def estimate(self) -> tuple[Floats, float]:
        """Centre and edge of a good cube by points of its surface: nothing is proven."""
        found = [self.settle(*self.climb(*s)) for s in self.starts(1)]
        return max(found, key=lambda f: f[1]) if found else (self.centre, 0.0)

    def base(self, local: Floats) -> Floats:
        """Base axes."""
        return np.asarray((local * self.shape) @ self.axes.T)

    @property
    def _left(self) -> int:
        return self.work - self.bounds.counter[0] + self.climbing

    def _inside(self, local: Floats) -> NDArray[np.bool_]:
        return self.bounds.inside(self.base(local))

    # Lower bound ----------------------------------------------------------------------------------

    def starts(self, count: int) -> list[tuple[Floats, float]]:
        """The roomiest nodes of a grid, and the cubes about them that hold no node that breaks a limit."""
        nodes = box_nodes(self.low, self.high, SAMPLES)
        grid = nodes.reshape(SAMPLES, SAMPLES, SAMPLES, 3)
        good: NDArray[np.bool_] = self._inside(nodes).reshape(grid.shape[:3])
        pairs = []
        for axis in range(3):
            a, b = np.moveaxis(grid, axis, 0), np.moveaxis(good, axis, 0)
            for here, there in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
                change = b[here] & ~b[there]
                pairs.append((a[here][change], a[there][change]))
        inside, outside = (np.concatenate([p[i] for p in pairs]) for i in (0, 1))
        self.witnesses = np.concatenate([grid[~good], self._pull(inside, outside, 6)])
        nodes = grid[good]
        if not len(nodes):
            self.names = self._broken(grid.reshape(-1, 3))
            return []
        room = self._room(self._tree(), nodes)
        order = np.argsort(-room, kind="stable")[:count]
        return [(nodes[i], float(room[i])) for i in order]

    def _broken(self, local: Floats) -> tuple[str, ...]:
        """Limits that points break, the one that most of them break first; reach where no point closes."""
        closed, limits = self.bounds.at(self.base(local))
        counts = {limit.name: int((closed & ~(limit.value <= limit.most)).sum()) for limit in limits}
        return tuple(sorted((n for n in counts if counts[n]), key=lambda n: -counts[n])) or (REACH,)

    def _pull(self, inside: Floats, outside: Floats, steps: int) -> Floats:
        """Broken points on the way to points that hold, as near to those as bisection comes."""
        for _ in range(steps):
            middle = (inside + outside) / 2
            good = self._inside(middle)[:, None]
            inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
        return outside

    def _tree(self) -> cKDTree:
        return cKDTree(self.witnesses if len(self.witnesses) else np.full((1, 3), 1e9))

    def _room(self, tree: cKDTree, centres: Floats) -> Floats:
        """Edge of the cube about each centre that touches the nearest counterexample or the region's border."""
        near = tree.query(centres, p=np.inf)[0]
        border = np.minimum(centres - self.low, self.high - centres).min(axis=1)
        return np.asarray(2 * np.minimum(near, border))

    def settle(self, centre: Floats, edge: float) -> tuple[Floats, float]:
        """Climbed until no limit is broken between the points that are watched."""
        for _ in range(SETTLED):
            if not self._touches(centre + SURFACE * edge / 2, SURFACE):
                break
            centre, edge = self.climb(centre, edge)
        return centre, edge

    def _touches(self, points: Floats, relative: Floats) -> bool:
        """Watches the point at which each limit is broken most; whether there was a new one."""
        closed, limits = self.bounds.at(self.base(points))
        self.climbing += len(points)
        new = []
        for limit in limits:
            excess = np.where(closed & np.isfinite(limit.value), limit.value - limit.most, -np.inf)
            worst = int(np.argmax(excess))
            if excess[worst] > 0 and np.abs(self.touched - relative[worst]).max(axis=1).min() > NEAR:
                new.append(relative[worst])
        if new:
            self.touched = np.concatenate([self.touched, new])
        return bool(new)

    def climb(self, centre: Floats, edge: float) -> tuple[Floats, float]:
        """Linear programs over the limits at the points watched, within a shrinking trust region."""
        trust, edge, before = 0.1 * self.size, 0.9 * edge, self.bounds.counter[0]
        while edge > self.gap and not self._inside(centre + self.touched * edge / 2).all():
            edge *= 0.8  # a limit between the counterexamples
        for _ in range(ROUNDS):
            better = self._program(centre, edge, trust)
            if better is None or better[1] <= edge + 0.1 * self.gap:
                trust *= 0.25
                if trust < 0.1 * self.gap:
                    break
                continue
            if self._inside(better[0] + self.touched * better[1] / 2).all():
                centre, edge = better
            else:
                trust *= 0.5
        self.climbing += self.bounds.counter[0] - before
        return centre, edge

    def _program(self, centre: Floats, edge: float, reach: float) -> tuple[Floats, float] | None:
        """Best cube with its centre within `reach`, limits at the points watched taken as linear."""
        points = centre + self.touched * edge / 2
        step = STEP * self.size
        closed, limits = self.bounds.at(self.base((points[:, None] + step * CROSS).reshape(-1, 3)))
        all_closed = closed.reshape(len(points), -1).all(axis=1)
        if not (limits and all_closed.any()):
            return None
        rows, room = [], []
        for limit in limits:
            arrays = limit.array.reshape(len(points), len(CROSS), -1)[all_closed]
            left = limit.left.reshape(len(points), len(CROSS), -1)[all_closed, 0]
            with np.errstate(invalid="ignore"):
                value = (arrays @ left[:, :, None])[..., 0]
                slope = (value[:, 1:4] - value[:, 4:7]) / (2 * step)
                rows.append(np.column_stack([slope, (slope * self.touched[all_closed]).sum(axis=1) / 2]))
            room.append(limit.most - value[:, 0])
        table, space = np.concatenate(rows), np.concatenate(room)
        finite = np.isfinite(table).all(axis=1) & np.isfinite(space)
        below, above = self.low - centre, self.high - centre
        sides = np.column_stack([np.kron(np.eye(3), [[1.0], [-1.0]]), np.full(6, 0.5)])  # stays in the region
        answer = linprog(
            [0, 0, 0, -1],
            A_ub=np.vstack([table[finite], sides]),
            b_ub=np.concatenate([space[finite], np.column_stack([above, -below]).ravel() - edge / 2]),
            bounds=[*np.clip(np.column_stack([below, above]), -reach, reach).tolist(), (-edge, reach)],
        )
        if answer.status != 0:
            return None
        return centre + answer.x[:3], edge + float(answer.x[3])

    def _prove(self, centre: Floats, edge: float) -> None:
        """The climbed cube, shrunk to what can be proven; moved away from what was found broken."""
        edge -= 0.1 * self.gap
        less = LESS
        for _ in range(AGAIN):
            if edge <= self.best or self._left <= self.work // 2:
                return
            share = max((self._left - self.work // 2) // 2, 500)
            begun = edge
            found = shrink(self.judge, self.axes, self.shape, centre, edge, self.best, 0.5 * self.gap, share)
            self.exhausted |= found.cells + 64 > share
            self.witnesses = np.concatenate([self.witnesses, found.broken])
            if found.edge > self.best:
                self.best, self.centre, self.names = found.edge, centre, found.names
            elif not self.names:
                self.names = found.names
            if self.best > begun - self.gap:
                return
            if found.edge == 0 and not len(found.broken):
                less *= 3  # limits that are all but touched: a little less is decided soon
                edge = max(self.best, (1 - less) * begun)
                continue
            if not len(found.broken):
                return
            relative = np.clip(2 * (found.broken - centre) / begun, -1, 1)
            if self._touches(found.broken, relative):
                centre, edge = self.settle(*self.climb(centre, max(self.best, 0.5 * begun)))
                edge -= 0.1 * self.gap
                continue
            centre, roomier = self._roomier(centre)
            if roomier <= self.best + 0.3 * self.gap:
                return
            edge = self.best + (min(roomier, edge) - self.best) / 2

    def _roomier(self, centre: Floats) -> tuple[Floats, float]:
        """A centre nearby with the most room between the counterexamples."""
        tree, step = self._tree(), 0.05 * self.size
        room = float(self._room(tree, centre[None])[0])
        while step > 0.05 * self.gap:
            trial = centre + step * FACES
            rooms = self._room(tree, trial)
            i = int(np.argmax(rooms))
            if rooms[i] > room:
                centre, room = trial[i], float(rooms[i])
            else:
                step *= 0.5
        return centre, room

    # Upper bound ----------------------------------------------------------------------------------

    def _cover(self) -> float:
        """Upper bounds from the region's size down to what was proven, as far as the work lasts."""
        upper = 2 * self.size
        target = self.size / 2
        last = self.best + 0.8 * self.gap
        while True:
            target = last if target < 1.1 * last else target
            if not self._excluded(target):
                self.exhausted = True
                return upper
            upper = target
            if target == last:
                return upper
            target /= 2

    def _excluded(self, target: float) -> bool:
        """Whether every centre is excluded by a pose that breaks a limit inside of every cube about its cell."""
        half = np.full(3, min(self.size / 16, target / 4))
        axes = [np.arange(a, b, 2 * h) + h for a, b, h in zip(self.low, self.high, half, strict=True)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        most = max(MOST_CELLS, 2 * len(cells))
        while True:
            cells = cells[self._room(self._tree(), cells) + 2 * half.max() > target]
            cells = self._struck(cells, target / 2 - half)
            if not len(cells):
                return True
            if len(cells) > most or self._left < 8 * len(cells) or half.min() < 0.02 * self.gap:
                return False
            for axis in self._worth(cells, half, target):
                half[axis] /= 2
                move = np.zeros(3)
                move[axis] = half[axis]
                cells = np.concatenate([cells - move, cells + move])

    def _worth(self, cells: Floats, half: Floats, target: float) -> list[int]:
        """Axes along which halving the cells excludes some: not those along which the limits hardly change."""
        if self._left < 40 * TRIED:
            return [0, 1, 2]
        some = cells[:: max(1, len(cells) // TRIED)]
        children = some + half / 2 * np.where(np.arange(len(some))[:, None] >> np.arange(3) & 1, 1.0, -1.0)

        def struck(which: list[int]) -> int:
            part, at = half.copy(), some.copy()
            part[which] /= 2
            at[:, which] = children[:, which]
            inner = target / 2 - part
            if (inner <= 0).any():
                return 0
            points = at[:, None] + inner * BOX
            good = self._inside(points.reshape(-1, 3)).reshape(len(some), 8)
            return int((~good.all(axis=1)).sum())

        every = struck([0, 1, 2])
        needed = [a for a in range(3) if struck([b for b in range(3) if b != a]) < 0.9 * every]
        return needed or [0, 1, 2]

    def _struck(self, cells: Floats, inner: Floats) -> Floats:
        """Cells whose shared cube holds no pose that breaks a limit, as far as corners and middles tell."""
        if (inner <= 0).any():
            return cells
        for points in (BOX, FACES[np.abs(FACES).sum(axis=1) < 3]):
            if not len(cells) or self._left < len(points) * len(cells):
                break
            at = cells[:, None] + inner * points
            good = self._inside(at.reshape(-1, 3)).reshape(len(cells), -1)
            hit = ~good.all(axis=1)
            struck = at[hit][~good[hit]]
            self.witnesses = np.concatenate([self.witnesses, struck[:: max(1, len(struck) // 2000)]])
            cells = cells[~hit]
            if len(cells) > 300:
                break
        return cells

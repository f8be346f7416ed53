"""Where the part should lie: many placements at once, the best of them refined, all of the path in reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from stiffmap.common.broadcasting import Floats, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import place_text
from stiffmap.common.tasks import workers
from stiffmap.machining.milling.equilibrium import RANGES, wall_errors
from stiffmap.machining.milling.limits import followed, must_follow
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.process.description import Process
from stiffmap.machining.toolpath import Placement, Toolpath, sampled
from stiffmap.solve.machine import Machine

AT_ONCE = 200_000
"""Poses of one call; on a cluster, of one task as many as `IN_A_TASK`."""
IN_A_TASK = 10_000
NORM = 12
"""Power of the mean that stands for the largest error while it is refined."""
REFINED = 3


@dataclass(frozen=True, eq=False)
class Placements:
    """n placements and the error of the part in each."""

    at: Floats
    """(n, 3) m."""
    turn: Floats
    """(n,) rad."""
    largest: Floats
    """(n,) m, across the wall, before compensation; infinite where a point of the path has no answer or breaks a limit."""
    best: Placement
    """Refined, and proven at all points of the path."""
    naive: Placement
    """The part's middle in the middle of the workspace, not turned."""
    limits: str
    """What keeps the error from being smaller."""
    naive_along: Floats
    """(k,) m, errors across the wall over the part at the naive placement."""
    best_along: Floats
    """(k,) m, the same at the best one; force and deflection solved together."""

    @property
    def best_error(self) -> float:
        """m, the largest at the best placement."""
        return float(np.abs(self.best_along).max())

    @property
    def naive_error(self) -> float:
        """m, the largest at the naive placement."""
        return float(np.abs(self.naive_along).max())

    @property
    def gain(self) -> float:
        """How many times the naive placement's error is the best one's."""
        return self.naive_error / self.best_error

    def words(self, tolerance: float | None = None) -> str:
        """One sentence; `tolerance` m: also whether a placement reaches it before compensation."""
        at = place_text(self.best.at, ".1f")
        best = f"{1e3 * self.best_error:.3f} mm at {at}, turned by {np.degrees(self.best.turn):.1f} deg"
        if tolerance is None or self.best_error <= tolerance:
            return f"Of {len(self.at)} placements the best leaves {best}; the middle of the workspace {1e3 * self.naive_error:.3f} mm."
        return (
            f"No placement of {len(self.at)} reaches the tolerance of {1e3 * tolerance:g} mm without compensation: the best leaves {best}; "
            f"what limits it: {self.limits}."
        )

    @property
    def three_times(self) -> float:
        """Share of the placements in reach whose error is more than three times the best one's."""
        fits = self.largest[np.isfinite(self.largest)]
        return float((fits > 3 * self.best_error).mean())


def placements(
    machine: Machine,
    path: Toolpath,
    process: Process,
    *,
    count: int = 1000,
    points: int = 500,
    threads: int | None = None,
    scheduler: object = None,
) -> Placements:
    """Search for the placement with the smallest largest error across the wall, before compensation.

    count: placements tried (a Sobol sequence over the machine's workspace and a full turn); points: number of points of the path in
    the search. scheduler: address of a dask scheduler, or a `distributed.Client`, whose workers try the placements, with the same
    answer. Raises StiffmapError where no placement holds the path.
    """
    whole_number(count, "place", 1)
    whole_number(points, "points", 2)
    search = PlacementSearch(machine, path, process, points, threads)
    naive = Placement((search.low + search.high) / 2 - search.middle, 0.0)
    from scipy.stats import qmc

    power = int(np.ceil(np.log2(max(count, 2))))
    unit = qmc.Sobol(4, seed=0).random_base2(power)[:count]
    turn = 2 * np.pi * unit[:, 3] - np.pi
    at = search.inside(unit[:, :3], turn)
    size = max(1, (AT_ONCE if scheduler is None else IN_A_TASK) // len(search.points))
    rows = [slice(k, k + size) for k in range(0, len(at), size)]
    with workers(PlacementSearch.largest, search, scheduler=scheduler) as hands:
        largest = np.concatenate(hands.in_order((at[r], turn[r]) for r in rows))
    if not np.isfinite(largest).any():
        must_follow(search.at_place(naive))
        raise StiffmapError(
            f"no placement of {count} holds the path on {machine.name}: it measures "
            f"{', '.join(f'{v:.0f}' for v in 1e3 * search.size)} mm, the box {', '.join(f'{v:.0f}' for v in 1e3 * (search.high - search.low))} mm"
        )
    order = np.argsort(largest)[:REFINED]
    with workers(PlacementSearch.refined, search, scheduler=scheduler) as hands:
        tried = hands.in_order((at[i], float(turn[i])) for i in order if np.isfinite(largest[i]))
    tried.append((search.exact(naive), naive))
    best = min(tried, key=lambda t: t[0])[1]
    along = search.errors(naive), search.errors(best)
    return Placements(at, turn, largest, best, naive, search.what_limits(best), *along)


class PlacementSearch:
    """Errors of one path on one machine at many placements in its workspace, from `low` to `high` (3,) m."""

    def __init__(
        self, machine: Machine, path: Toolpath, process: Process, points: int, threads: int | None
    ) -> None:
        self.machine, self.path, self.process, self.threads = machine, path, process, threads
        length = float(path.length[path.cuts].sum())
        self.points = sampled(path, max(length / points, 1e-6))
        if len(self.points) > 1.3 * points:  # a table of points
            keep = np.unique(np.linspace(0, len(self.points) - 1, points).astype(int))
            self.points = self.points.only(keep)
        self.job = self.at_place(Placement(np.zeros(3), 0.0))
        still = np.zeros((len(self.job), 2))
        self.force, self.slope = self.job.force(still), self.job.force_slopes(still)[:, :, 0]
        # along what the machine does not command the part has one place
        steered = np.isin(["x", "y", "z"], machine.description.task)
        self.low, self.high = np.where(steered, machine.workspace, machine.description.home.p)
        p = self.points.position
        self.middle = (p.max(axis=0) + p.min(axis=0)) / 2
        self.size = np.ptp(p, axis=0)

    def at_place(self, place: Placement) -> Setting:
        return setting(self.machine, self.path, self.process, self.points, place, threads=self.threads)

    def _extent(self, turn: Floats) -> tuple[Floats, Floats]:
        """(n, 3) lowest and highest corner of the path turned (n,) rad about its origin."""
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        x, y, z = self.points.position.T
        u, v = c * x - s * y, s * x + c * y
        one = np.ones(len(turn))
        low = np.stack([u.min(axis=1), v.min(axis=1), z.min() * one], axis=1)
        return low, np.stack([u.max(axis=1), v.max(axis=1), z.max() * one], axis=1)

    def inside(self, unit: Floats, turn: Floats) -> Floats:
        """(n, 3) m: places for shares (n, 3) of the room that the turned part has in the workspace; where it has none, the middle."""
        a, b = self._extent(turn)
        first, last = self.low - a, self.high - b
        middle = (first + last) / 2
        first, last = np.minimum(first, middle), np.maximum(last, middle)
        return np.asarray(np.where(self.high - b >= self.low - a, first + unit * (last - first), middle))

    def largest(self, some: tuple[Floats, Floats]) -> Floats:
        """(n,) m: largest error at n places (n, 3) m and turns (n,) rad, the cut answering to first order; infinite where a point fails."""
        at, turn = some
        places = [Placement(a, float(t)) for a, t in zip(at, turn, strict=True)]
        r = np.stack([p.rotation for p in places])
        position = np.einsum("nij,mj->nmi", r, self.points.position) + at[:, None]
        force = np.einsum("nij,mj->nmi", r, self.force)
        off = np.einsum("nij,mj->nmi", r, self.job.off)
        wrench = np.concatenate([force, np.zeros_like(force)], axis=-1)
        s = self.machine.solve(position, wrench, rotation=self.job.turns(), threads=self.threads)
        slope = np.einsum("nij,mj->nmi", r, self.slope)
        bent = np.matmul(s.compliance[..., :3, :3], slope[..., None])[..., 0]
        loop = 1 - np.einsum("nmi,nmi->nm", off, bent)  # 1 + kp/k
        good = s.ok & (s.flags & RANGES == 0) & (loop > 0) & followed(self.job, position)
        error = np.einsum("nmi,nmi->nm", s.displacement[..., :3], off)
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.abs(error / loop).max(axis=1)
        return np.asarray(np.where(good.all(axis=1), error, np.inf))

    def exact(self, place: Placement) -> float:
        """m: largest error, cut and deflection solved together; infinite where a point fails."""
        return float(np.abs(self.errors(place)).max())

    def errors(self, place: Placement) -> Floats:
        """(k,) m across the wall at the points of the search; infinite where one fails."""
        job = self.at_place(place)
        return np.where(followed(job, job.position), wall_errors(job), np.inf)

    def refined(self, begin: tuple[Floats, float]) -> tuple[float, Placement]:
        """Error and placement after a descent from a place and a turn along the gradient of a high mean of the errors, within the workspace."""
        at, turn = begin
        scale = np.array([*np.maximum(self.high - self.low, 1e-3), 1.0])

        def cost(x: Floats) -> float:
            e = self.errors(Placement(x[:3] * scale[:3], float(x[3])))
            top = float(np.abs(e).max())
            if not np.isfinite(top):
                return 1e3
            return 1e3 * top * float(((np.abs(e) / top) ** NORM).mean() ** (1 / NORM))

        a, b = self._extent(np.array([turn]))
        first, last = np.minimum(self.low - a[0], at), np.maximum(self.high - b[0], at)
        bounds = np.array([[*first, -np.pi], [*last, np.pi]]) / scale
        begun, options = np.array([*at, turn]) / scale, {"maxiter": 12, "eps": 1e-4}
        found = minimize(cost, begun, method="L-BFGS-B", bounds=bounds.T, options=options)
        places = [Placement(at, turn), Placement(found.x[:3] * scale[:3], float(found.x[3]))]
        errors = [self.exact(p) for p in places]
        best = int(np.argmin(errors))
        return errors[best], places[best]

    def what_limits(self, place: Placement) -> str:
        """Sides of the workspace that the part touches, else the machine's stiffness there."""
        a, b = self._extent(np.array([place.turn]))
        names = [
            f"{side} {axis}"
            for side, gap in (("low", place.at + a[0] - self.low), ("high", self.high - place.at - b[0]))
            for axis, g in zip("xyz", gap, strict=True)
            if g < 1e-3
        ]
        return f"the box at {', '.join(names)}" if names else "the machine's stiffness"

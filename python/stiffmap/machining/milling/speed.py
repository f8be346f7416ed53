"""Speeds of a cut: the least time within the tolerance; whether the teeth make it chatter along the path, and at which speeds of the
spindle they do not (docs/vibration.md)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.chatter.cut import milling_process, modes_of_machine
from stiffmap.machining.chatter.lobes import multipliers_at
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.limits import STILL, drive_speeds, fastest
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.process import EndMill, Kienzle
from stiffmap.solve.status import Flag
from stiffmap.workspace.vibration.modes import tip_modes

ROUNDS = 20
SLOWEST, FASTEST = 0.02, 4.0
"""Of the feed as it is."""
EFFORT_ROOM = 1.001
"""Force at which the drives are still strong enough, as a multiple: the compensated positions lie a little elsewhere."""


@dataclass(frozen=True, eq=False)
class Feeds:
    """Feed of each move."""

    feed: Floats
    """(moves,) m/s; that of the path where a move does not cut."""
    time: float
    """s of all cuts."""
    before: float
    """s with the feed as it is."""
    held: NDArray[np.bool_]
    """(moves,) bool: the error stays within the tolerance, and the drives within their efforts."""


def best_feeds(job: Setting, tolerance: float | None = None) -> Feeds:
    """Largest feed of each move at which no point of it is off by more than the tolerance (m), before compensation.

    Within the drives' speeds and efforts (of the cut as it is and of the wanted one), and FASTEST times the feed as it is; by bisection at all
    points at once, the force re-evaluated.
    """
    t = job.process.tolerance if tolerance is None else tolerance
    if t is None or not t > 0:
        raise StiffmapError("tolerance: expected a length above zero (m), from the process or given")
    rates, most = np.abs(drive_speeds(job)), fastest(job.machine)
    if (moved := (most <= STILL) & (rates > STILL).any(axis=0)).any():
        name = job.machine.actuators[int(np.argmax(moved))]
        raise StiffmapError(f"feeds: the path moves {name}, which is declared to stand still (speed 0)")
    top = np.minimum((most / np.maximum(rates, STILL)).min(axis=1), FASTEST)

    def strong(share: Floats) -> NDArray[np.bool_]:
        faster = replace(job, feed=job.feed * share, faster=job.faster * share, scale=job.scale * EFFORT_ROOM)
        plant = Plant(faster)
        wanted = plant.stand(job.position, faster.force(np.zeros((len(job), 2))), full=True)
        flags = wanted.flags | equilibrium(plant, job.position).flags
        return np.asarray(flags & Flag.DRIVE_FORCE == 0)

    def exact(share: Floats) -> NDArray[np.bool_]:
        faster = replace(job, feed=job.feed * share, faster=job.faster * share)
        e = equilibrium(Plant(faster), job.position)
        return np.asarray(np.abs(np.nan_to_num(job.across(e.error), nan=np.inf)) <= t)

    borne = _largest(strong, np.full(len(job), SLOWEST), top)
    share = _largest(exact, np.full(len(job), SLOWEST), borne)
    holds_low = exact(np.full(len(job), SLOWEST)) & strong(np.full(len(job), SLOWEST))
    feed = job.path.feed.copy()
    held = np.ones(len(job.path), bool)
    total = before = 0.0
    for i in np.unique(job.points.move):
        rows = np.flatnonzero(job.points.move == i)
        feed[i] = job.feed[rows].min() * share[rows].min()
        held[i] = bool(holds_low[rows].all())
        total += job.path.length[i] / feed[i]
        before += job.path.length[i] / job.feed[rows].min()
    return Feeds(feed, float(total), float(before), held)


def _largest(good: Callable[[Floats], NDArray[np.bool_]], low: Floats, high: Floats) -> Floats:
    """(m,) largest share from low to high that is good, by bisection; low where none is found."""
    whole = good(high)
    least, most = low, high
    for _ in range(0 if whole.all() else ROUNDS):
        middle = (least + most) / 2
        ok = good(middle)
        least, most = np.where(ok, middle, least), np.where(ok, most, middle)
    return np.where(whole, high, least)


PLACES, SPEEDS = 24, 61
SPAN = (0.5, 1.5)
"""Speeds that are tried, as multiples of the process's."""
CLEAR = 0.97
"""Multipliers of the speeds that are offered are below this."""


@dataclass(frozen=True, eq=False)
class PathStability:
    """Multipliers of the cut at places along a path, at the depth of the process."""

    way: Floats
    """(places,) m along the path."""
    multiplier: Floats
    """(places,) at the process's speed; above 1 the cut chatters."""
    speed: Floats
    """(speeds,) rad/s that were tried."""
    worst: Floats
    """(speeds,) largest multiplier along the path."""
    damping: str

    @property
    def unstable(self) -> int:
        """Number of places where the cut chatters."""
        return int((self.multiplier > 1).sum())

    @property
    def offered(self) -> Floats:
        """(k,) rad/s: up to five tried speeds that are stable all along the path, nearest to the process's first."""
        good = self.speed[self.worst < CLEAR]
        middle = self.speed[len(self.speed) // 2]
        return good[np.argsort(np.abs(good - middle), kind="stable")][:5]

    def sentence(self, spindle: float) -> str:
        """What it means, in words."""
        rpm = 60 / (2 * pi)
        if not self.unstable:
            return (
                f"The cut is stable at {len(self.way)} places along the path (largest multiplier "
                f"{self.multiplier.max():.3f}; damping {self.damping})."
            )
        text = (
            f"The cut chatters at {self.unstable} of {len(self.way)} places along the path (multiplier up to "
            f"{self.multiplier.max():.3f} at {spindle * rpm:.0f} rpm; damping {self.damping})."
        )
        if not self.offered.size:
            low, high = self.speed[[0, -1]] * rpm
            return f"{text} No speed from {low:.0f} to {high:.0f} rpm is stable everywhere: take less depth."
        return f"{text} Stable everywhere: {', '.join(f'{s * rpm:.0f}' for s in self.offered)} rpm."


def path_stability(job: Setting) -> PathStability | str:
    """Stability along a job's path; a sentence where it cannot be judged (no teeth, no masses)."""
    p = job.process
    if not isinstance(p.law, EndMill | Kienzle) or not p.tool.teeth:
        return "Stability is not judged: a coated tool has no teeth whose passes a chip could remember."
    p = milling_process(p)
    places = np.unique(np.linspace(0, len(job) - 1, PLACES).round().astype(int))
    try:
        turned = job.rotation[places]
        modes = tip_modes(job.machine, job.position[places], rotation=turned, threads=job.threads)
    except StiffmapError as problem:
        return f"Stability is not judged: {problem}"
    speed = p.spindle * np.linspace(*SPAN, SPEEDS)
    depth = np.array([p.cut.axial])
    kept, table = [], []
    for k, i in enumerate(places):
        if not np.isfinite(modes.rest[k, 0, 0]):
            continue
        own = modes_of_machine(modes, k).turned(job.axes[i]).below(np.inf)
        kept.append(i)
        table.append(multipliers_at(own, p, speed, depth, None, job.threads)[:, 0])
    if not table:
        return "Stability is not judged: no place along the path has an equilibrium."
    mu_all = np.array(table)
    at = SPEEDS // 2
    return PathStability(job.points.way[kept], mu_all[:, at], speed, mu_all.max(axis=0), modes.damping.said)

"""Feed and sense of the cut: the least time within the tolerance; climb or conventional."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.limits import STILL, drive_speeds, fastest
from stiffmap.machining.milling.setting import Setting
from stiffmap.machining.process.description import Process
from stiffmap.solve.status import Flag

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
    limited_by: tuple[str, ...]
    """(moves,) tolerance, drive effort, drive speed, or fastest feed asked for."""


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
    why = ["does not cut"] * len(job.path)
    total = before = 0.0
    for i in np.unique(job.points.move):
        rows = np.flatnonzero(job.points.move == i)
        at = rows[int(np.argmin(share[rows]))]
        feed[i] = job.feed[rows].min() * share[at]
        held[i] = bool(holds_low[rows].all())
        why[i] = _limit(share[at], borne[at], top[at])
        total += job.path.length[i] / feed[i]
        before += job.path.length[i] / job.feed[rows].min()
    return Feeds(feed, float(total), float(before), held, tuple(why))


def _largest(good: Callable[[Floats], NDArray[np.bool_]], low: Floats, high: Floats) -> Floats:
    """(m,) largest share from low to high that is good, by bisection; low where none is found."""
    whole = good(high)
    least, most = low, high
    for _ in range(0 if whole.all() else ROUNDS):
        middle = (least + most) / 2
        ok = good(middle)
        least, most = np.where(ok, middle, least), np.where(ok, most, middle)
    return np.where(whole, high, least)


def _limit(share: float, borne: float, top: float) -> str:
    """What keeps a move from being faster."""
    if share < borne:
        return "tolerance"
    if borne < top:
        return "drive effort"
    return "drive speed" if top < FASTEST else "fastest feed asked for"


def other_side(process: Process) -> Process:
    """Conventional for climb and the other way round; a slot stays what it is."""
    side = {"climb": "conventional", "conventional": "climb", "slot": "slot"}[process.cut.side]
    return replace(process, cut=replace(process.cut, side=side))

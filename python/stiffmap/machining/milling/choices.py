"""What is chosen before a cut is computed: sense of the travel, placement, entry, turns of an arm about its tool."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.milling.equilibrium import Plant, equilibrium
from stiffmap.machining.milling.placement import Placements, placements
from stiffmap.machining.milling.redundancy import Redundancy, redundancy as best_turns
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.process.description import Process
from stiffmap.machining.process.load import GivenProcess, as_process
from stiffmap.machining.toolpath import Toolpath, box, load_path, sampled
from stiffmap.machining.toolpath.engagement import part_side, within_tool
from stiffmap.machining.toolpath.outlines import entered_at, outline_of, turned_round
from stiffmap.solve.machine import Machine

OFFSETS = tuple(f"G{n}" for n in range(54, 60))
"""Work offsets that a program can name."""


@dataclass(frozen=True)
class Entry:
    """Where to enter a closed outline: the tool that enters is not yet pushed, so that it leaves a step as high as the error there."""

    way: float
    """m along the cuts, from where the path enters now."""
    step: float | None = None
    """m: size of the error across the wall there, before compensation, which is the step that the entry leaves; None: not searched for."""
    given: float | None = None
    """m: the same where the path enters now."""


@dataclass(frozen=True, eq=False)
class Choices:
    """A path on a machine, and what was chosen on the way to it."""

    job: Setting
    placement: Placements | None = None
    entry: Entry | None = None
    redundancy: Redundancy | None = None


def choices(
    machine: Machine,
    path: Toolpath | str | PathLike[str],
    process: GivenProcess,
    *,
    at: ArrayLike | None = None,
    turn: float = 0.0,
    stock: ArrayLike | None = None,
    angle: Floats | None = None,
    size: tuple[float, ...] | None = None,
    offset: Mapping[str, ArrayLike] | None = None,
    tolerance: float | None = None,
    place: int | None = None,
    reverse: bool = False,
    entry: float | Literal["best"] | None = None,
    redundancy: int | None = None,
    scheduler: object = None,
    progress: Callable[[int], None] | None = None,
    step: float,
    thickness: float | None,
    threads: int | None,
) -> Choices:
    """In this order: the sense, the placement, the entry, the turns; arguments as of `mill`. Raises StiffmapError."""
    cut = as_process(process)
    if tolerance is not None:
        cut = replace(cut, tolerance=within_tool(tolerance, "tolerance", cut))
    if isinstance(path, Toolpath):
        if size is not None or offset:
            raise StiffmapError(
                "size, offset: only of a built-in outline, or of a file; a toolpath has both in it"
            )
        p = path
    else:
        if lost := [n for n in offset or () if n not in OFFSETS]:
            raise StiffmapError(f"offset: expected names from {OFFSETS[0]} to {OFFSETS[-1]}; got '{lost[0]}'")
        shifts = {n: np.asarray(o, dtype=float).tolist() for n, o in offset.items()} if offset else None
        if shifts:
            shifts.setdefault(OFFSETS[0], [0.0, 0.0, 0.0])
        p = load_path(path, feed=cut.feed, spindle=cut.spindle, size=size, offsets=shifts, progress=progress)
    if reverse:
        p, cut = turned_round(p), other_side(cut)
    block = None if stock is None else box(stock)
    tried = None
    if place is not None:
        if at is not None or turn:
            raise StiffmapError("place: not together with at or turn, which it finds")
        tried = placements(machine, p, cut, count=place, threads=threads, scheduler=scheduler)
        at, turn = tried.best.at, tried.best.turn
    origin = machine.description.home.p if at is None else at

    def job(path: Toolpath, turns: Floats | None) -> Setting:
        return setting(
            machine, path, cut, sampled(path, step), path.placed(origin, turn), stock=block, angle=turns,
            thickness=thickness, threads=threads,
        )  # fmt: skip

    def turned(path: Toolpath) -> Redundancy | None:
        if redundancy is None:
            return None
        return best_turns(job(path, None), redundancy, scheduler=scheduler)

    turns = turned(p)
    here = None
    if entry is not None:
        now = angle if turns is None else turns.angle
        here = best_entry(job(p, now)) if isinstance(entry, str) else Entry(entry)
        p = entered_at(p, here.way)
        turns = turned(p)
    last = angle if turns is None else turns.angle
    return Choices(job(p if last is None else replace(p, turn=None), last), tried, here, turns)


def best_entry(job: Setting) -> Entry:
    """The point of a closed outline with the least error across the wall; inside corners are none. Raises StiffmapError for other paths."""
    outline_of(job.path)
    e = equilibrium(Plant(job), job.position)
    size = np.abs(np.where(np.isfinite(e.error), e.error, np.inf) * job.off).sum(axis=1)
    normal = np.abs((np.nan_to_num(e.error) * job.off).sum(axis=1))
    normal = np.where(np.isfinite(size) & (job.engaged.corner == 0) & job.engaged.wall, normal, np.inf)
    k = int(np.argmin(normal))
    return Entry(float(job.points.way[k]), float(normal[k]), float(normal[0]))


def part_lies(job: Setting) -> str | None:
    """A sentence on which side of a closed outline the part lies, and how to change it; None for slots and other paths."""
    try:
        outline_of(job.path)
    except StiffmapError:
        return None
    side, p = job.process.cut.side, job.position - job.position[0]
    if side == "slot":
        return None
    area = float((np.cross(p[:-1], p[1:]) * job.tool[1:]).sum())
    words = ("outside", "inside") if part_side(job.process) * area < 0 else ("inside", "outside")
    return (
        f"Seen from the spindle the outline is travelled {'counter-clockwise' if area > 0 else 'clockwise'}; in a {side} cut the part "
        f"lies {words[0]} it. If it lies {words[1]}, exchange climb and conventional in the process file (`side` of `cut`)."
    )


def other_side(process: Process) -> Process:
    """Conventional for climb and the other way round; a slot stays what it is."""
    side = {"climb": "conventional", "conventional": "climb", "slot": "slot"}[process.cut.side]
    return replace(process, cut=replace(process.cut, side=side))

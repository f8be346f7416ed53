"""`stiffmap.map_estimate`: time, memory and disk of a map before it is made."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from time import perf_counter
from typing import Any

import numpy as np

from stiffmap.common.outputs import bytes_text
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.block import solve_block
from stiffmap.workspace.maps.plan import MapPlan, map_plan
from stiffmap.workspace.maps.tiles import POSES_AT_ONCE, blocks_of, tiles_of

SAMPLES = 8
COPIES = 3
"""Of a tile that are in memory at once while it is solved and written."""


@dataclass(frozen=True)
class MapEstimate:
    """What a map will need; the times are those of a sample of its poses, on this machine, now."""

    poses: int
    seconds: float
    """Expected time."""
    slowest: float
    """Time if all poses took as long as the slowest part of the sample (s)."""
    result_bytes: int
    """Size of the map in memory (`out=None`) and, at most, on the disk."""
    working_bytes: int
    """Memory in addition to the interpreter and its libraries while a map is written to Zarr."""

    def __str__(self) -> str:
        return (
            f"{self.poses:,} poses: about {duration(self.seconds)} (at most {duration(self.slowest)}); "
            f"{bytes_text(self.result_bytes)} on the disk before compression, {bytes_text(self.working_bytes)} of memory "
            "while Zarr is written"
        )


@keywords_of(map_plan)
def map_estimate(machine: Machine | str | PathLike[str], **call: Any) -> MapEstimate:
    """Time, memory and disk of `error_map` with these arguments, from solving a sample of its poses.

    Raises StiffmapError for bad input.
    """
    plan = map_plan(as_machine(machine), **call)
    poses = plan.rows * plan.x.size
    each = int(sum(np.dtype(v.dtype).itemsize * int(np.prod(plan.tail(v))) for v in plan.variables))
    per_pose = _times(plan)
    tile = tiles_of(plan).height * plan.x.size
    return MapEstimate(
        poses=poses,
        seconds=float(poses * np.mean(per_pose)),
        slowest=float(poses * np.max(per_pose)),
        result_bytes=poses * each,
        working_bytes=COPIES * tile * each,
    )


def _times(plan: MapPlan) -> list[float]:
    """Seconds per pose of parts spread over the map; the first is solved twice, to leave out what is prepared."""
    blocks = blocks_of(slice(0, plan.rows), plan.x.size, POSES_AT_ONCE)
    chosen = [blocks[i] for i in np.unique(np.linspace(0, len(blocks) - 1, SAMPLES).astype(int))]
    solve_block(plan, chosen[0])
    out = []
    for rows in chosen:
        start = perf_counter()
        solve_block(plan, rows)
        out.append((perf_counter() - start) / ((rows.stop - rows.start) * plan.x.size))
    return out


def duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.3g} {unit}"
    return f"{seconds:.2g} s"

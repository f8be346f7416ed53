"""`stiffmap.error_map`, and `stiffmap.map_estimate`: time, memory and disk of a map before it is made."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import bytes_text, needs_space, only_job
from stiffmap.model.files.load import Source
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine, as_machine, hint_metres
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.block import POSES_AT_ONCE, Work, solve_block, work_of
from stiffmap.workspace.maps.files import is_zarr, onto_disk, partial_folder, read_dataset, write_dataset
from stiffmap.workspace.maps.loading import track
from stiffmap.workspace.maps.plan import MapPlan, blocks_of, map_plan
from stiffmap.workspace.maps.store import Store, ZarrMap, folder_store, memory_store, open_zarr_map

OTHER_FORMATS = (".csv", ".json", ".ods", ".parquet", ".txt", ".xlsx", ".yaml")


@keywords_of(map_plan)
def error_map(
    machine: Machine | Source,
    *,
    chunk: int | None = None,
    progress: bool | None = None,
    out: str | PathLike[str] | None = None,
    resume: bool = False,
    scheduler: object = None,
    **call: Any,
) -> xr.Dataset:
    """How far the machine is pushed off its commanded position, over a grid of positions.

    Parameters
    ----------
    x, y, z
        Commanded TCP positions, m, base axes: one number or an axis of numbers each. None: over the machine's
        workspace (`points` positions along an axis, three planes of z; a coordinate that is not commanded stays at home).
    wrench
        (6,) N, N·m at `point`; (cases, 6) or a mapping name -> (6,) for several load cases, which
        adds the dimension ``case``.
    cases
        Names of the load cases.
    plane
        ``xy``, ``xz`` or ``yz``: pure forces are turned in this plane to find its weakest and its
        strongest direction. None: leave that out (half of the variables, a tenth of the work).
    force
        Magnitude of the turning force, N; None: that of the wrench's force, the largest of the cases.
    directions
        Number of equally spaced directions solved before the extremes are searched, 3 or more. 4
        suffices where the machine is nearly linear; take 16 or more with play or hard stops.
    tolerance
        Deflection (m) that defines the force limit.
    compliance
        Whether to keep the loaded compliance, (…, 6, 6).
    uncertainty
        Add standard deviations, from the covariance of identified links and the uncertainties ``u`` in
        the machine file, to first order: displacement_std, deflection_std and deflection_xy_std per load
        case, worst_deflection_std and worst_deflection_xy_std, and variance_share (…, parameter), the
        share of each number in the variance of the deflection (`stiffmap.uncertainty_ranking`).
    point, rotation, gravity, load_type, method, load_steps, threads
        As in `Machine.solve`; `rotation` is one (3, 3) matrix for the whole map.
    chunk
        Poses solved at once; memory in addition to the result grows with it, no number depends on it.
    progress
        Show a progress bar on standard error; None: where that is a terminal.
    out
        Also write the map there: NetCDF, or Zarr where the name ends in ``.zarr``. It then grows on
        the disk, not in memory, and the Dataset that is returned reads it when used. Zarr is written once, in
        chunks that can be read while the rest is missing; it is the form for maps of more than 10^7 poses.
    resume
        Take up what an interrupted run of the same call left next to `out`.
    scheduler
        Address of a dask scheduler, or a `distributed.Client`: its workers solve the map, tile by tile
        (docs/big_maps.md). No number depends on it.

    Returns
    -------
    Dataset with dimensions (z, y, x[, case]): displacement (…, component), deflection (norm of the
    TCP's translation), deflection_xy (in the plane), status, flags; over the force directions of the
    plane (z, y, x): worst_deflection, worst_direction, best_deflection, best_direction, force_limit,
    each of the whole translation and, with the suffix ``_xy``, in the plane; direction_status, the
    highest status among the directions. SI units; unreachable, unstable and not converged poses hold
    NaN and their status. Attributes say what was computed, of what machine and how.

    Raises
    ------
    StiffmapError
        For bad input.
    FileError
        Where `out` cannot be written.
    """
    machine = as_machine(machine)
    plan = map_plan(machine, **call)
    work = work_of(chunk, scheduler)
    if out is None:
        if resume:
            raise StiffmapError("resume: nothing is kept without out=, next to which an interrupted run lies")
        store = memory_store(plan)
        _fill(plan, store, work.parts(plan), work, progress)
        ds = plan.dataset(store.arrays)
        hint_metres(machine, np.r_[plan.x, plan.y, plan.z], bool((ds.status == Status.UNREACHABLE).all()))
        return ds
    target = Path(out)
    if target.suffix in OTHER_FORMATS:
        raise StiffmapError(
            f"out: expected a name that ends in .nc or .zarr, found {target.name!r}; tables: stiffmap map --format csv"
        )
    write = _to_zarr if is_zarr(target) else _to_netcdf
    with only_job(target):
        write(plan, target, resume, work, progress)
    return read_dataset(target)


def _fill(
    plan: MapPlan, store: Store | ZarrMap, parts: Sequence[slice], work: Work, progress: bool | None
) -> None:
    """Solve the parts that are not done."""
    missing = [rows for rows in parts if not store.done[rows].all()]
    for number, values in track(work.solved(plan, missing), len(missing), "map", progress):
        store.put(missing[number], values)


def _to_netcdf(plan: MapPlan, out: Path, resume: bool, work: Work, progress: bool | None) -> None:
    folder = partial_folder(out)
    with onto_disk(out, f"; a map of {plan.rows * plan.x.size} poses"):
        store = folder_store(plan, folder, resume)
    needs_space(out, sum(a.nbytes for a in store.arrays.values()), "the finished map")
    _fill(plan, store, work.parts(plan), work, progress)
    write_dataset(plan.dataset(store.arrays), out)
    shutil.rmtree(folder)


def _to_zarr(plan: MapPlan, out: Path, resume: bool, work: Work, progress: bool | None) -> None:
    store = open_zarr_map(plan, partial_folder(out), resume)
    _fill(plan, store, plan.tiles, work, progress)
    store.finish(out)


SAMPLES = 8
COPIES = 3  # of a tile that are in memory at once while it is solved and written


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
    tile = plan.tile_height * plan.x.size
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

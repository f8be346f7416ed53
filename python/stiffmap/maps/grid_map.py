"""`stiffmap.error_map`."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.errors import StiffmapError
from stiffmap.machine import Machine
from stiffmap.maps.block import solve_block
from stiffmap.maps.files import partial_folder, read_dataset, write_dataset
from stiffmap.maps.inputs import axis, magnitude, plane_axes, plane_force, wrench_cases
from stiffmap.maps.loading import Loading
from stiffmap.maps.plan import MapPlan
from stiffmap.maps.progress import track
from stiffmap.maps.store import Store, folder_store, memory_store
from stiffmap.maps.uncertainty import uncertain_numbers

POSES_AT_ONCE = 1024


def error_map(
    machine: Machine,
    *,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    wrench: ArrayLike | Mapping[str, ArrayLike] | None = None,
    cases: Sequence[str] | None = None,
    plane: str | None = "xy",
    force: float | None = None,
    directions: int = 4,
    tolerance: float = 0.25e-3,
    compliance: bool = False,
    uncertainty: bool = False,
    point: str = "tcp",
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    load_type: str = "dead",
    method: str = "fast",
    load_steps: int | str = "auto",
    threads: int | None = None,
    chunk: int | None = None,
    progress: bool | None = None,
    out: str | PathLike[str] | None = None,
    resume: bool = False,
) -> xr.Dataset:
    """How far the machine is pushed off its commanded position, over a grid of positions.

    Parameters
    ----------
    x, y, z
        Commanded TCP positions, m, base axes: one number or an axis of numbers each.
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
        Poses solved at once; memory beside the result grows with it, no number depends on it.
    progress
        Show a progress bar on standard error; None: where that is a terminal.
    out
        Also write the map there: NetCDF, or Zarr where the name ends in ``.zarr``. It then grows on
        the disk, not in memory, and the Dataset that is returned reads it when used.
    resume
        Take up what an interrupted run of the same call left beside `out`.

    Returns
    -------
    Dataset with dimensions (z, y, x[, case]): displacement (…, component), deflection (norm of the
    TCP's translation), deflection_xy (in the plane), status, flags; over the force directions of the
    plane (z, y, x): worst_deflection, worst_direction, best_deflection, best_direction, force_limit,
    each of the whole translation and, with the suffix ``_xy``, in the plane; direction_status, the
    highest status among the directions. SI units; unreachable, unstable and not converged poses hold
    NaN and their status. Attributes say what was computed, of what machine and how.

    Raises StiffmapError for bad input, FileError where `out` cannot be written.
    """
    loading = Loading(
        machine,
        point=point,
        rotation=rotation,
        gravity=gravity,
        load_type=load_type,
        method=method,
        load_steps=load_steps,
        threads=threads,
    )
    wrenches, names = wrench_cases(wrench, None if cases is None else tuple(cases))
    if directions < 3:
        raise StiffmapError(f"directions: expected 3 or more, got {directions}")
    plan = MapPlan(
        loading=loading,
        x=axis(x, "x"),
        y=axis(y, "y"),
        z=axis(z, "z"),
        wrenches=wrenches,
        cases=names,
        shown_plane="xy" if plane is None else "".join("xyz"[i] for i in plane_axes(plane)),
        turning=plane is not None,
        force=0.0 if plane is None else plane_force(wrenches, force),
        directions=directions,
        tolerance=magnitude(tolerance, "tolerance", "m"),
        compliance=compliance,
        uncertain=uncertain_numbers(machine) if uncertainty else None,
    )
    if out is None:
        store = memory_store(plan)
        fill(plan, store, chunk, progress)
        return plan.dataset(store.arrays)
    return _on_disk(plan, Path(out), resume, chunk, progress)


def fill(plan: MapPlan, store: Store, chunk: int | None, progress: bool | None) -> None:
    """Solve the rows that are not done, block by block."""
    poses = POSES_AT_ONCE if chunk is None else chunk
    if poses < 1:
        raise StiffmapError(f"chunk: expected 1 or more, got {chunk}")
    step = max(1, poses // plan.x.size)
    blocks = [slice(i, min(i + step, plan.rows)) for i in range(0, plan.rows, step)]
    try:
        for rows in track(blocks, len(blocks), "map", progress):
            if not store.done[rows].all():
                store.put(rows, solve_block(plan, rows))
    finally:
        store.flush()


def _on_disk(plan: MapPlan, out: Path, resume: bool, chunk: int | None, progress: bool | None) -> xr.Dataset:
    folder = partial_folder(out)
    store = folder_store(plan, folder, resume)
    fill(plan, store, chunk, progress)
    write_dataset(plan.dataset(store.arrays), out)
    shutil.rmtree(folder)
    return read_dataset(out)

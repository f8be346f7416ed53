"""`stiffmap.map_statistics`: the figures of a map that is never stored."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.labels import meaning, status_attrs
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.block import work_of
from stiffmap.workspace.maps.inputs import number_list
from stiffmap.workspace.maps.loading import track
from stiffmap.workspace.maps.plan import MapPlan, Variable, map_plan
from stiffmap.workspace.maps.summary import readings, values_of

NODE = ("x", "y", "z")
DEFLECTION = re.compile(r"(worst_|best_)?deflection(_xy|_xz|_yz)?")


@keywords_of(map_plan)
def map_statistics(
    machine: Machine | str | PathLike[str],
    *,
    percentiles: Sequence[float] = (50, 95, 99),
    chunk: int | None = None,
    progress: bool | None = None,
    scheduler: object = None,
    **call: Any,
) -> xr.Dataset:
    """Worst values, percentiles and shares within the tolerance of a map, without storing the map.

    Parameters
    ----------
    percentiles
        In per cent, of the converged poses.
    chunk, progress, scheduler
        As in `error_map`; no number depends on them.
    call
        The other arguments of `error_map`: x, y, z, wrench, plane, tolerance, gravity ...

    Returns
    -------
    Dataset with dimensions (z[, case]); for each deflection of `error_map` (m): NAME_max with NAME_max_position
    (…, node: x, y, z of the first such pose, m), NAME_within (share of the plane's area within the tolerance,
    failed poses count as outside), NAME_percentile (percentile, z[, case]) and NAME_percentile_map
    (percentile[, case]), NAME_column_max (y, x[, case], the worst of all z); status_count (z[, case], status).
    Maxima, shares and counts are exact; a percentile is at most 0.2 % above the exact one, never below it.

    Raises
    ------
    StiffmapError
        For bad input.
    """
    wanted = number_list(percentiles, "percentiles")
    if not ((wanted >= 0) & (wanted <= 100)).all():
        raise StiffmapError(f"percentiles: expected numbers from 0 to 100, got {wanted.tolist()}")
    plan = map_plan(as_machine(machine), **call)
    work = work_of(chunk, scheduler)
    found = {v.name: _Deflection(plan, v) for v in plan.variables if DEFLECTION.fullmatch(v.name)}
    counts = np.zeros((plan.z.size, len(plan.wrenches), len(Status)), dtype=np.int64)
    for index, values in track(work.solved(plan, plan.tiles), len(plan.tiles), "map", progress):
        for name, one in found.items():
            one.add(plan.tiles[index], values[name])
        plane, _ = plan.place(plan.tiles[index])
        status = values["status"].reshape(-1, len(plan.wrenches))
        counts[plane] += np.stack([(status == s).sum(0) for s in Status], axis=-1)
    out: dict[str, object] = {}
    for name, one in found.items():
        out |= one.variables(name, wanted)
    counted = counts if plan.case else counts[:, 0]
    out["status_count"] = (("z", *plan.case, "status"), counted, meaning("1", "poses of each status"))
    coords = {k: v for k, v in plan.coords.items() if k not in ("component", "parameter")}
    coords |= {"node": xr.Variable("node", np.array(NODE)), "percentile": xr.Variable("percentile", wanted)}
    coords["status"] = xr.Variable("status", np.array(list(Status), dtype=np.uint8), status_attrs("poses"))
    bound = f"at most {100 * RELATIVE_WIDTH:.2g} % above the exact value, never below it"
    return xr.Dataset(out, coords, plan.attrs | {"tolerance_m": plan.tolerance, "percentile_bound": bound})


class _Deflection:
    """What is kept of one deflection while the tiles pass by, in any order."""

    def __init__(self, plan: MapPlan, variable: Variable) -> None:
        nz, ny, nx = plan.shape
        self.plan, self.case = plan, variable.dims
        self.cases = cases = len(plan.wrenches) if variable.dims else 1
        self.most = np.full((nz, cases), np.nan)
        self.place = np.zeros((nz, cases), dtype=np.int64)
        self.column = np.full((ny, nx, cases), np.nan)
        self.within = np.zeros((nz, ny, cases))
        self.histograms = [[Histogram() for _ in range(cases)] for _ in range(nz)]

    def add(self, tile: slice, values: Floats) -> None:
        """Values (rows, x[, case]) of a tile."""
        plane, y = self.plan.place(tile)
        a = values.reshape(y.stop - y.start, self.plan.x.size, self.cases)
        self.column[y] = np.fmax(self.column[y], a)
        widths = cells(self.plan.x)
        self.within[plane, y] = ((a <= self.plan.tolerance) * widths[:, None]).sum(1)
        for c in range(self.cases):
            flat = a[..., c].ravel()
            self.histograms[plane][c].add(flat)
            if np.isnan(flat).all():
                continue
            here = int(np.nanargmax(flat))
            value, place = flat[here], y.start * self.plan.x.size + here
            first = value == self.most[plane, c] and place < self.place[plane, c]
            if first or not self.most[plane, c] >= value:
                self.most[plane, c], self.place[plane, c] = value, place

    def variables(self, name: str, percentiles: Floats) -> dict[str, xr.Variable]:
        """Variables of the Dataset."""
        p = self.plan
        iy, ix = np.divmod(self.place, p.x.size)
        nodes = np.stack([p.x[ix], p.y[iy], np.broadcast_to(p.z[:, None], ix.shape)], axis=-1)
        nodes = np.where(np.isnan(self.most)[..., None], np.nan, nodes)
        heights = cells(p.y)
        share = (self.within * heights[:, None]).sum(1) / (heights.sum() * cells(p.x).sum())
        # A bin's upper edge may lie beyond the largest value.
        each = np.array([[h.percentiles(percentiles) for h in row] for row in self.histograms])
        each = np.fmin(each, self.most[..., None])
        total = [Histogram(*(row[c].count for row in self.histograms)) for c in range(self.cases)]
        both = np.fmin([h.percentiles(percentiles) for h in total], np.fmax.reduce(self.most)[:, None])
        of = f"of {name}"
        table = {
            "max": (("z", "case"), self.most, "m", f"largest value {of}"),
            "max_position": (("z", "case", "node"), nodes, "m", f"pose of the largest value {of}"),
            "within": (("z", "case"), share, "1", f"share of the area {of} within tolerance_m"),
            "percentile": (("percentile", "z", "case"), np.moveaxis(each, -1, 0), "m", f"percentiles {of}"),
            "percentile_map": (("percentile", "case"), both.T, "m", f"percentiles {of} over the whole map"),
            "column_max": (("y", "x", "case"), self.column, "m", f"largest value {of} over z"),
        }
        made = {f"{name}_{n}": xr.Variable(dims, v, meaning(*what)) for n, (dims, v, *what) in table.items()}
        return made if self.case else {n: v.isel(case=0) for n, v in made.items()}


def cells(axis: Floats) -> Floats:
    """Width of the cell around each node of an axis; equal where the axis has one node."""
    if axis.size == 1:
        return np.ones(1)
    order = np.argsort(axis)
    half = np.diff(axis[order]) / 2
    width = np.empty(axis.size)
    width[order] = np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])
    return width


BITS = 9
RELATIVE_WIDTH = 2.0**-BITS  # width of a bin against its lower edge, at most
_SHIFT = 52 - BITS


class Histogram:
    """Counts over bins that share a floating-point number's sign, exponent and leading bits."""

    def __init__(self, *counts: Counter[int]) -> None:
        self.count = sum(counts, Counter[int]())

    def add(self, values: Floats) -> None:
        """Count the values (n,), not negative; NaN are left out."""
        kept = np.ascontiguousarray(values[~np.isnan(values)], dtype=np.float64) + 0.0
        bins, counts = np.unique(kept.view(np.int64) >> _SHIFT, return_counts=True)
        self.count.update(dict(zip(bins.tolist(), counts.tolist(), strict=True)))

    def percentiles(self, percent: Floats) -> Floats:
        """Upper edges of the bins that hold the values of rank ceil(p n / 100); NaN where nothing was counted."""
        if not self.count:
            return np.full(percent.shape, np.nan)
        bins = np.array(sorted(self.count), dtype=np.int64)
        upto = np.cumsum([self.count[b] for b in bins.tolist()])
        rank: NDArray[np.float64] = np.maximum(np.ceil(percent / 100 * upto[-1]), 1)
        chosen = bins[np.searchsorted(upto, rank)]
        zero = chosen == 0  # the first bin begins at 0; a rigid machine stays there
        return np.where(zero, 0.0, ((chosen + 1) << _SHIFT).view(np.float64))


def statistics_rows(ds: xr.Dataset, plane: str) -> list[dict[str, Any]]:
    """A row per plane and reading: largest value (m), its pose (m), percentiles (m), share of the area within."""
    rows = []
    for z in ds.z.values:
        here = ds.sel(z=z)
        for force, how in readings(ds, plane).items():
            names = ("max", "max_position", "percentile", "within")
            most, at, each, share = (values_of(here, how, f"_{n}").values.tolist() for n in names)
            percentiles = dict(zip(ds.percentile.values.tolist(), each, strict=True))
            rows.append({"z": float(z), "force": force, "max": most, "at": at, "percentiles": percentiles,
                         "share_within": share})  # fmt: skip
    return rows

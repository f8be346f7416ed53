"""An error map in a few numbers: deflections per plane, their standard deviations, and the worst pose with what its deflection
comes from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import vector_text
from stiffmap.solve.budget import budget_where_stable
from stiffmap.solve.machine import Machine


def across(ds: xr.Dataset) -> str:
    """The axis whose values are the planes: the one with the fewest, z before y before x."""
    return min(("z", "y", "x"), key=lambda a: ds.sizes[a])


def summary(ds: xr.Dataset, plane: str, tolerance: float) -> list[dict[str, Any]]:
    """Per plane and reading of the force's direction: least, median, largest deflection in the plane of
    the force (m), or in space of a force that is not in it, share of the poses within the tolerance; failed poses do not count as within."""
    ds, axis = ds.load(), across(ds)
    return [
        {axis: float(at), "force": name} | _sizes(values_of(ds, how).sel({axis: at}).values, tolerance)
        for at in ds[axis].values
        for name, how in readings(ds, plane).items()
    ]


class Reading(NamedTuple):
    """A variable of a map, and the load case where it has one."""

    variable: str
    case: str | None = None


def readings(ds: xr.Dataset, plane: str) -> dict[str, Reading]:
    """What a map is read for: the worst and the best direction, then its load cases."""
    turned = {w: Reading(f"{w}_deflection_{plane}") for w in ("worst", "best")}
    return turned | {str(c): Reading(name_of(ds, plane, c), str(c)) for c in ds.case.values}


def values_of(ds: xr.Dataset, reading: Reading, suffix: str = "") -> xr.DataArray:
    """The values of a reading, or of what is next to it, such as ``_std``."""
    values = ds[reading.variable + suffix]
    return values if reading.case is None else values.sel(case=reading.case)


def name_of(ds: xr.Dataset, plane: str, case: object) -> str:
    """The deflection that a case is judged by: in the plane where its force lies in it, else in space."""
    wrench = ds.wrench.sel(case=case)
    outside = [v for n, v in zip(wrench.wrench_component.values, wrench.values, strict=True)
               if str(n)[0] == "f" and str(n)[1] not in plane]  # fmt: skip
    return "deflection" if any(outside) else f"deflection_{plane}"


def _sizes(values: Floats, tolerance: float) -> dict[str, float]:
    good = values[np.isfinite(values)]
    least, median, most = (good.min(), np.median(good), good.max()) if good.size else (np.nan,) * 3
    share = float((good <= tolerance).sum() / values.size)
    return {"min": float(least), "median": float(median), "max": float(most), "share_within": share}


def band(ds: xr.Dataset, plane: str) -> list[dict[str, Any]]:
    """Per plane and reading of the force's direction: median and largest standard deviation (m) of the
    deflection in the plane, and the largest relative to its deflection."""
    rows, axis = [], across(ds)
    for at in ds[axis].values:
        for force, how in uncertain_readings(ds, plane).items():
            size, std = (values_of(ds, how, of).sel({axis: at}).values for of in ("", "_std"))
            rows.append({axis: float(at), "force": force} | _deviations(size, std))
    return rows


def uncertain_readings(ds: xr.Dataset, plane: str) -> dict[str, Reading]:
    """Those of `readings` whose standard deviations are reported: all but the best direction."""
    return {name: how for name, how in readings(ds, plane).items() if name != "best"}


def _deviations(size: Floats, std: Floats) -> dict[str, float]:
    good = np.isfinite(std) & (size > 0)
    sizes = std[good] if good.any() else np.array([np.nan])
    relative = std[good] / size[good] if good.any() else sizes
    return {
        "median_std": float(np.median(sizes)),
        "max_std": float(sizes.max()),
        "max_relative": float(relative.max()),
    }


def worst_pose(machine: Machine, ds: xr.Dataset, gravity: ArrayLike | None) -> dict[str, Any] | None:
    """The largest deflection of the map: load, position (m), deflection (m), shares of the elements and of their sources.

    The load is a case of the map, or the force that turned, in its worst direction there. None where no pose has an
    answer, or its deflection none to share.
    """
    found = _worst(ds)
    if found is None:
        return None
    size, load, p, wrench = found
    budget = budget_where_stable(machine, p, wrench, gravity=gravity)
    if budget is None:
        return None
    return {
        "case": load,
        "position": p,
        "wrench": [float(v) for v in wrench],
        "deflection": size,
        "shares": {n: s for n, _, s in budget.ranked()},
        "sources": budget.by_source,
    }


def _worst(ds: xr.Dataset) -> tuple[float, str, list[float], Floats] | None:
    """Deflection (m), load in words, position (m) and wrench (6,): of a case, or of the directions in which the force turned."""
    sizes: list[tuple[xr.DataArray, tuple[str, ...]]] = [(ds.deflection, ("z", "y", "x", "case"))]
    sizes += [(ds.worst_deflection, ("z", "y", "x"))] if "worst_deflection" in ds else []
    largest = [v.isel(v.argmax(axes)) for v, axes in sizes if np.isfinite(v).any()]
    if not largest:
        return None
    there = max(largest, key=float)
    p = [float(there[a]) for a in "xyz"]
    if "case" in there.coords:
        case = str(there.case.values)
        return float(there), case, p, ds.wrench.sel(case=case).values
    plane, force = ds.worst_direction.attrs["plane"], ds.attrs["turning_force_N"]
    angle = float(ds.worst_direction.sel({a: there[a] for a in "xyz"}))
    wrench = np.zeros(6)
    wrench[["xyz".index(a) for a in plane]] = force * np.cos(angle), force * np.sin(angle)
    load = f"{vector_text(wrench[:3], 3)} N, the worst direction in the {plane} plane"
    return float(there), load, p, wrench

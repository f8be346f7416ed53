"""The numbers of an error map in a few rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table

from stiffmap.ui.cli.statuses import failed
from stiffmap.ui.cli.table_text import table
from stiffmap.workspace.maps.plan import BEYOND


def across(ds: xr.Dataset) -> str:
    """The axis whose values are the planes: the one with the fewest, z before y before x."""
    return min(("z", "y", "x"), key=lambda a: ds.sizes[a])


def summary(ds: xr.Dataset, plane: str, tolerance: float) -> list[dict[str, Any]]:
    """Per plane and reading of the force's direction: least, median, largest deflection in the plane of
    the force (m), or in space of a force that is not in it, share of the poses within the tolerance; failed poses do not count as within."""
    ds, axis = ds.load(), across(ds)
    read = {name: values_of(ds, how) for name, how in readings(ds, plane).items()}
    return [
        {axis: float(at), "force": name} | _row(values.sel({axis: at}).values, tolerance)
        for at in ds[axis].values
        for name, values in read.items()
    ]


def readings(ds: xr.Dataset, plane: str) -> dict[str, dict[str, Any]]:
    """What a map is read for: the worst and the best direction, then its load cases; each with its variable and case."""
    turned: dict[str, dict[str, Any]] = {
        w: {"variable": f"{w}_deflection_{plane}"} for w in ("worst", "best")
    }
    return turned | {str(c): {"variable": name_of(ds, plane, c), "case": str(c)} for c in ds.case.values}


def values_of(ds: xr.Dataset, reading: dict[str, str], suffix: str = "") -> xr.DataArray:
    """The values of a reading, or of what is next to it, such as ``_std``."""
    values = ds[reading["variable"] + suffix]
    return values.sel(case=reading["case"]) if "case" in reading else values


def label(ds: xr.Dataset, plane: str, name: str) -> str:
    """A reading as tables call it."""
    if name in ("worst", "best"):
        return f"{name} direction"
    return f"{name}, |d| in space" if name_of(ds, plane, name) == "deflection" else name


def name_of(ds: xr.Dataset, plane: str, case: object) -> str:
    """The deflection that a case is judged by: in the plane where its force lies in it, else in space."""
    wrench = ds.wrench.sel(case=case)
    outside = [v for n, v in zip(wrench.wrench_component.values, wrench.values, strict=True)
               if str(n)[0] == "f" and str(n)[1] not in plane]  # fmt: skip
    return "deflection" if any(outside) else f"deflection_{plane}"


def _row(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], tolerance: float) -> dict[str, float]:
    good = values[np.isfinite(values)]
    least, median, most = (good.min(), np.median(good), good.max()) if good.size else (np.nan,) * 3
    share = float((good <= tolerance).sum() / values.size)
    return {"min": float(least), "median": float(median), "max": float(most), "share_within": share}


def failures(ds: xr.Dataset) -> dict[str, int]:
    """Number of poses per status in which some load or direction failed."""
    return failed(np.maximum(ds.direction_status.values, ds.status.max("case").values))


def beyond(ds: xr.Dataset) -> dict[str, Any] | None:
    """Share of the map (poses and loads) beyond what a calibrated machine was calibrated by; None: it was not."""
    if BEYOND not in ds:
        return None
    return {"share": float(ds[BEYOND].mean()), "calibrated_by": str(ds[BEYOND].attrs["calibrated_by"])}


def as_table(ds: xr.Dataset, rows: list[dict[str, Any]], plane: str, tolerance: float) -> Table:
    """For the terminal, mm."""
    axis = across(ds)
    out = table(
        f"{ds.attrs['machine']}: deflection in the {plane} plane, mm, under {ds.attrs['turning_force_N']:g} N",
        (f"{axis}, mm", "force", "min", "median", "max", f"within {tolerance:g} mm"),
        left=("force",),
    )
    for r in rows:
        sizes = (f"{1e3 * r[k]:.3f}" if np.isfinite(r[k]) else "–" for k in ("min", "median", "max"))
        out.add_row(
            f"{1e3 * r[axis]:g}", label(ds, plane, r["force"]), *sizes, f"{100 * r['share_within']:.1f} %"
        )
    return out

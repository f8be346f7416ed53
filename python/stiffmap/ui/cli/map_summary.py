"""The numbers of an error map in a few rows: deflections, their uncertainty and where it comes from, and the worst pose with the
elements that its deflection comes from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table
from rich.text import Text

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, vector_text
from stiffmap.model.description.sources import in_words as source_words
from stiffmap.solve.budget import deflection_budget, in_shares
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import MM
from stiffmap.ui.cli.output import failed, table
from stiffmap.workspace.maps.plan import BEYOND

RANKED = 8
"""Numbers in the table of shares in the variance."""


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


def _sizes(values: Floats, tolerance: float) -> dict[str, float]:
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


def band(ds: xr.Dataset, plane: str) -> list[dict[str, Any]]:
    """Per plane and reading of the force's direction: median and largest standard deviation (m) of the
    deflection in the plane, and the largest relative to its deflection."""
    rows, axis = [], across(ds)
    for at in ds[axis].values:
        for force, how in _readings(ds, plane).items():
            size, std = (values_of(ds, how, of).sel({axis: at}).values for of in ("", "_std"))
            rows.append({axis: float(at), "force": force} | _deviations(size, std))
    return rows


def _readings(ds: xr.Dataset, plane: str) -> dict[str, dict[str, Any]]:
    return {name: how for name, how in readings(ds, plane).items() if name != "best"}


def _deviations(size: Any, std: Any) -> dict[str, float]:
    good = np.isfinite(std) & (size > 0)
    if not good.any():
        return {"median_std": np.nan, "max_std": np.nan, "max_relative": np.nan}
    relative = std[good] / size[good]
    return {
        "median_std": float(np.median(std[good])),
        "max_std": float(std[good].max()),
        "max_relative": float(relative.max()),
    }


def uncertainty_data(ds: xr.Dataset, plane: str) -> dict[str, Any]:
    """For ``--json``, SI."""
    from stiffmap.workspace.maps import uncertainty_ranking

    ranking = uncertainty_ranking(ds)
    return {
        "rows": band(ds, plane),
        "ranking": [{"number": str(p.parameter.values), "share": float(p)} for p in ranking],
        "method": ds.attrs["uncertainty_method"],
        "left_out": ds.attrs["uncertainty_left_out"],
    }


def uncertainty_told(ds: xr.Dataset, data: dict[str, Any], plane: str) -> Iterator[Table | Text]:
    """Two tables, mm and per cent."""
    axis = across(ds)
    out = table(
        f"standard deviation of the deflection in the {plane} plane, mm",
        (f"{axis}, mm", "force", "median", "max", "max, relative"),
        left=("force",),
    )
    for r in data["rows"]:
        sizes = [f"{1e3 * r[k]:.4f}" for k in ("median_std", "max_std")]
        relative = f"{100 * r['max_relative']:.1f} %"
        out.add_row(f"{1e3 * r[axis]:g}", label(ds, plane, r["force"]), *sizes, relative)
    yield out
    shares = ((r["number"], f"{100 * r['share']:.2f} %") for r in data["ranking"][:RANKED])
    title = "share in the variance of the deflection, whole map"
    yield table(title, ("number", "share"), shares, left=("number",))
    if data["left_out"]:
        yield Text(f"not propagated: {data['left_out']}", "yellow")


def deviation_figures(ds: xr.Dataset, plane: str) -> Iterator[tuple[str, Any]]:
    """A picture of the worst direction's standard deviation and one per load case."""
    from stiffmap.ui.plot import map_figure

    for name, how in _readings(ds, plane).items():
        own = {**how, "variable": f"{how['variable']}_std"}
        yield f"map-{name}-std.png", map_figure(ds, **own, tolerance=None)


def worst_pose(machine: Machine, ds: Any, gravity: Any) -> dict[str, Any] | None:
    """The largest deflection of the map: load, position (m), deflection (m), shares of the elements and of their sources.

    The load is a case of the map, or the force that turned, in its worst direction there. None where no pose has an
    answer, or its deflection none to share.
    """
    found = _worst(ds)
    if found is None:
        return None
    size, load, p, wrench = found
    try:
        budget = deflection_budget(machine, p, wrench, gravity=gravity)
    except StiffmapError:
        return None
    return {
        "case": load,
        "position": p,
        "wrench": [float(v) for v in wrench],
        "deflection": size,
        "shares": {n: s for n, _, s in budget.ranked()},
        "sources": budget.by_source,
    }


def _worst(ds: Any) -> tuple[float, str, list[float], Any] | None:
    """Deflection (m), load in words, position (m) and wrench (6,): of a case, or of the directions in which the force turned."""
    sizes: list[tuple[Any, tuple[str, ...]]] = [(ds.deflection, ("z", "y", "x", "case"))]
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
    return (
        float(there),
        f"{vector_text(wrench[:3], 3)} N, the worst direction in the {plane} plane",
        p,
        wrench,
    )


def in_words(worst: dict[str, Any]) -> str:
    """``worst pose of the map: (300, 300, -200) mm, 932.5 µm in space under …, 57 % from z.foot …; 83 % of it …``."""
    at = ", ".join(f"{v / MM:.4g}" for v in worst["position"])
    rests = source_words(worst["sources"])
    return (
        f"worst pose of the map: ({at}) mm, {length_text(worst['deflection'])} in space under {worst['case']}; "
        f"{in_shares(worst['shares'])}{'; ' + rests if rests else ''}"
    )

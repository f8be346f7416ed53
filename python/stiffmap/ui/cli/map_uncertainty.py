"""The uncertainty band of an error map, and where it comes from, in a few rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table
from rich.text import Text

from stiffmap.ui.cli.map_summary import across, label, readings, values_of
from stiffmap.ui.cli.table_text import table

SHOWN = 8


def band(ds: xr.Dataset, plane: str) -> list[dict[str, Any]]:
    """Per plane and reading of the force's direction: median and largest standard deviation (m) of the
    deflection in the plane, and the largest relative to its deflection."""
    rows, axis = [], across(ds)
    for at in ds[axis].values:
        for force, how in _readings(ds, plane).items():
            size, std = (values_of(ds, how, of).sel({axis: at}).values for of in ("", "_std"))
            rows.append({axis: float(at), "force": force} | _row(size, std))
    return rows


def _readings(ds: xr.Dataset, plane: str) -> dict[str, dict[str, Any]]:
    return {name: how for name, how in readings(ds, plane).items() if name != "best"}


def _row(size: Any, std: Any) -> dict[str, float]:
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
        sizes = (
            f"{1e3 * r['median_std']:.4f}",
            f"{1e3 * r['max_std']:.4f}",
            f"{100 * r['max_relative']:.1f} %",
        )
        out.add_row(f"{1e3 * r[axis]:g}", label(ds, plane, r["force"]), *sizes)
    yield out
    shares = ((r["number"], f"{100 * r['share']:.2f} %") for r in data["ranking"][:SHOWN])
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

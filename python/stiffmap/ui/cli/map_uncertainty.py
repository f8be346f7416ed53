"""The uncertainty band of an error map, and where it comes from, in a few rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table
from rich.text import Text

from stiffmap.ui.cli.map_summary import across
from stiffmap.ui.cli.table_text import table

SHOWN = 8


def band(ds: xr.Dataset, plane: str) -> list[dict[str, Any]]:
    """Per plane and reading of the force's direction: median and largest standard deviation (m) of the
    deflection in the plane, and the largest relative to its deflection."""
    names = {"worst": (f"worst_deflection_{plane}", None)}
    names |= {str(c): (f"deflection_{plane}", c) for c in ds.case.values}
    rows, axis = [], across(ds)
    for at in ds[axis].values:
        for force, (name, case) in names.items():
            pick = {axis: at} if case is None else {axis: at, "case": case}
            size, std = ds[name].sel(pick).values, ds[f"{name}_std"].sel(pick).values
            rows.append({axis: float(at), "force": force} | _row(size, std))
    return rows


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


def uncertainty_told(data: dict[str, Any], plane: str) -> Iterator[Table | Text]:
    """Two tables, mm and per cent."""
    axis = next(a for a in "xyz" if a in data["rows"][0])
    out = table(
        f"standard deviation of the deflection in the {plane} plane, mm",
        (f"{axis}, mm", "force", "median", "max", "max, relative"),
        left=("force",),
    )
    for r in data["rows"]:
        name = "worst direction" if r["force"] == "worst" else r["force"]
        sizes = (
            f"{1e3 * r['median_std']:.4f}",
            f"{1e3 * r['max_std']:.4f}",
            f"{100 * r['max_relative']:.1f} %",
        )
        out.add_row(f"{1e3 * r[axis]:g}", name, *sizes)
    yield out
    shares = ((r["number"], f"{100 * r['share']:.2f} %") for r in data["ranking"][:SHOWN])
    title = "share in the variance of the deflection, whole map"
    yield table(title, ("number", "share"), shares, left=("number",))
    if data["left_out"]:
        yield Text(f"not propagated: {data['left_out']}", "yellow")


def deviation_figures(ds: xr.Dataset, plane: str) -> Iterator[tuple[str, Any]]:
    """A picture of the worst direction's standard deviation and one per load case."""
    from stiffmap.ui.plot.deviations import deviation_figure

    chosen: dict[str, dict[str, Any]] = {"worst": {"variable": f"worst_deflection_{plane}"}}
    chosen |= {str(c): {"variable": f"deflection_{plane}", "case": str(c)} for c in ds.case.values}
    yield from ((f"map-{n}-std.png", deviation_figure(ds, **how)) for n, how in chosen.items())

"""The uncertainty band of an error map, and where it comes from, in a few rows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich import box
from rich.console import Console
from rich.table import Table

from stiffmap.ui.cli.map_summary import across

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


def print_uncertainty(console: Console, data: dict[str, Any], plane: str) -> None:
    """Two tables, mm and per cent."""
    title = f"standard deviation of the deflection in the {plane} plane, mm"
    table = Table(box=box.SIMPLE_HEAD, title=title)
    axis = next(a for a in "xyz" if a in data["rows"][0])
    for head in (f"{axis}, mm", "force", "median", "max", "max, relative"):
        table.add_column(head, justify="left" if head == "force" else "right")
    for r in data["rows"]:
        name = "worst direction" if r["force"] == "worst" else r["force"]
        sizes = (
            f"{1e3 * r['median_std']:.4f}",
            f"{1e3 * r['max_std']:.4f}",
            f"{100 * r['max_relative']:.1f} %",
        )
        table.add_row(f"{1e3 * r[axis]:g}", name, *sizes)
    console.print(table)
    shares = Table(box=box.SIMPLE_HEAD, title="share in the variance of the deflection, whole map")
    shares.add_column("number")
    shares.add_column("share", justify="right")
    for r in data["ranking"][:SHOWN]:
        shares.add_row(r["number"], f"{100 * r['share']:.2f} %")
    console.print(shares)
    if data["left_out"]:
        console.print(f"[yellow]not propagated: {data['left_out']}[/yellow]")


def draw_deviations(ds: xr.Dataset, output: Path, plane: str) -> list[Path]:
    """A picture of the worst direction's standard deviation and one per load case."""
    from stiffmap.ui.plot import map_figure, save

    chosen: dict[str, dict[str, Any]] = {"worst": {"variable": f"worst_deflection_{plane}_std"}}
    chosen |= {str(c): {"variable": f"deflection_{plane}_std", "case": str(c)} for c in ds.case.values}
    return [
        save(map_figure(ds, **how, tolerance=None), output / f"map-{n}-std.png") for n, how in chosen.items()
    ]

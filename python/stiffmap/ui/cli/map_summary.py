"""The numbers of an error map in a few rows: deflections, their uncertainty and where it comes from, and the worst pose with the
elements that its deflection comes from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table
from rich.text import Text

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import length_text, vector_text
from stiffmap.model.description.sources import in_words as source_words
from stiffmap.solve.budget import budget_where_stable, in_shares
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import MM
from stiffmap.ui.cli.output import failed, failed_in_words, table
from stiffmap.workspace.maps.plan import BEYOND

RANKED = 8
"""Numbers in the table of shares in the variance."""


@dataclass(frozen=True)
class MapSummary:
    """An error map with what a person or a program asks of it first."""

    machine: Machine
    ds: xr.Dataset
    plane: str
    tolerance: float
    """m."""
    given: str
    """Force and tolerance, and where they come from."""
    gravity: Any
    uncertainty: bool
    """Whether the standard deviations are reported."""

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The table's rows, as of `summary`."""
        return summary(self.ds, self.plane, self.tolerance)

    @cached_property
    def failed(self) -> dict[str, int]:
        """Number of poses per status in which some load or direction failed."""
        return failed(np.maximum(self.ds.direction_status.values, self.ds.status.max("case").values))

    @cached_property
    def worst(self) -> dict[str, Any] | None:
        """As of `worst_pose`."""
        return worst_pose(self.machine, self.ds, self.gravity)

    @cached_property
    def band(self) -> dict[str, Any]:
        """Standard deviations (m) and where they come from."""
        from stiffmap.workspace.maps import uncertainty_ranking

        ranking = uncertainty_ranking(self.ds)
        return {
            "rows": band(self.ds, self.plane),
            "ranking": [{"number": str(p.parameter.values), "share": float(p)} for p in ranking],
            "method": self.ds.attrs["uncertainty_method"],
            "left_out": self.ds.attrs["uncertainty_left_out"],
        }

    def as_plain(self, files: Sequence[Path]) -> dict[str, Any]:
        """Data of JSON, SI, with the files that were written."""
        out: dict[str, Any] = {"machine": self.machine.name, "rows": self.rows, "failed": self.failed}
        out |= {"files": files, "worst_pose": self.worst}
        if BEYOND in self.ds:  # poses and loads beyond what a calibrated machine was calibrated by
            far = self.ds[BEYOND]
            out["beyond_calibration"] = {
                "share": float(far.mean()), "calibrated_by": str(far.attrs["calibrated_by"]),
            }  # fmt: skip
        return out | ({"uncertainty": self.band} if self.uncertainty else {})

    def lines(self) -> Iterator[str | Table | Text]:
        """For the terminal, mm and per cent."""
        yield self.given
        yield self.table()
        yield from self._deviations() if self.uncertainty else ()
        if self.worst is not None:
            yield in_words(self.worst)
        if BEYOND in self.ds:
            share, by = float(self.ds[BEYOND].mean()), self.ds[BEYOND].attrs["calibrated_by"]
            words = f"{100 * share:.3g} % of it beyond what the machine was calibrated by ({by})"
            yield Text(words, "yellow" if share else "")
        yield from failed_in_words(self.failed)

    def table(self) -> Table:
        """Deflections, mm."""
        force, within = self.ds.attrs["turning_force_N"], f"within {1e3 * self.tolerance:g} mm"
        title = f"{self.machine.name}: deflection in the {self.plane} plane, mm, under {force:g} N"
        cells = (
            [f"{1e3 * r[k]:.3f}" if np.isfinite(r[k]) else "–" for k in ("min", "median", "max")]
            + [f"{100 * r['share_within']:.1f} %"]
            for r in self.rows
        )
        return self._by_plane(title, ("min", "median", "max", within), self.rows, cells)

    def _deviations(self) -> Iterator[Table | Text]:
        title = f"standard deviation of the deflection in the {self.plane} plane, mm"
        rows = self.band["rows"]
        cells = (
            [f"{1e3 * r['median_std']:.4f}", f"{1e3 * r['max_std']:.4f}", f"{100 * r['max_relative']:.1f} %"]
            for r in rows
        )
        yield self._by_plane(title, ("median", "max", "max, relative"), rows, cells)
        shares = ((r["number"], f"{100 * r['share']:.2f} %") for r in self.band["ranking"][:RANKED])
        title = "share in the variance of the deflection, whole map"
        yield table(title, ("number", "share"), shares, left=("number",))
        if self.band["left_out"]:
            yield Text(f"not propagated: {self.band['left_out']}", "yellow")

    def _by_plane(
        self, title: str, heads: Sequence[str], rows: list[dict[str, Any]], cells: Iterable[list[str]]
    ) -> Table:
        """A row per plane and reading of the force's direction."""
        axis = across(self.ds)
        first = ([f"{1e3 * r[axis]:g}", label(self.ds, self.plane, r["force"])] for r in rows)
        whole = (a + b for a, b in zip(first, cells, strict=True))
        return table(title, (f"{axis}, mm", "force", *heads), whole, left=("force",))


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
    sizes = std[good] if good.any() else np.array([np.nan])
    relative = std[good] / size[good] if good.any() else sizes
    return {
        "median_std": float(np.median(sizes)),
        "max_std": float(sizes.max()),
        "max_relative": float(relative.max()),
    }


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

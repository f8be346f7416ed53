"""The numbers of an error map in a few rows: deflections, their uncertainty and where it comes from, and the worst pose with the
elements that its deflection comes from; and the files that are written next to it: pictures, tables, the report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
import xarray as xr
from rich.table import Table
from rich.text import Text

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import length_text, place_text
from stiffmap.model.description.machine import in_words as source_words
from stiffmap.solve.budget import in_shares
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli.inputs import options_given
from stiffmap.ui.cli.output import as_text, failed, failed_in_words, table, write_files
from stiffmap.workspace.maps.files import write_map_table
from stiffmap.workspace.maps.plan import BEYOND
from stiffmap.workspace.maps.summary import (
    across,
    band,
    name_of,
    readings,
    summary,
    uncertain_readings,
    worst_pose,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RANKED = 8  # numbers in the table of shares in the variance


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


def assumptions(context: typer.Context, force: str, tolerance: float) -> str:
    """The force and the tolerance, and where they come from: the command line, or the default."""
    values = {"force": f"({force}) N" if "," in force else f"{force} N", "tolerance": f"{tolerance:g} mm"}
    given = options_given(context)
    taken = [n for n in values if n not in given]
    own = [f"{n} {v}" for n, v in values.items() if n in given]
    text = f"{_sentence(own)} as given. " if own else ""
    if not taken:
        return text.rstrip()
    are, they = ("are those", "they are") if len(taken) > 1 else ("is that", "it is")
    return (
        f"{text}{_sentence([f'{n} {values[n]}' for n in taken])} {are} of the Orthoglide's application in the paper; {they} used "
        f"because the machine file has none. Give your own by {' and '.join(f'--{n}' for n in taken)}."
    )


def _sentence(parts: Sequence[str]) -> str:
    """``Force 300 N and tolerance 0.25 mm``."""
    text = " and ".join(parts)
    return text[:1].upper() + text[1:]


def label(ds: xr.Dataset, plane: str, name: str) -> str:
    """A reading as tables call it."""
    if name in ("worst", "best"):
        return f"{name} direction"
    return f"{name}, |d| in space" if name_of(ds, plane, name) == "deflection" else name


def deviation_figures(ds: xr.Dataset, plane: str) -> Iterator[tuple[str, Any]]:
    """A picture of the worst direction's standard deviation and one per load case."""
    from stiffmap.ui.plot import map_figure

    for name, how in uncertain_readings(ds, plane).items():
        figure = map_figure(ds, f"{how.variable}_std", case=how.case, tolerance=None)
        yield f"map-{name}-std.png", figure


def in_words(worst: dict[str, Any]) -> str:
    """``worst pose of the map: (300, 300, -200) mm, 932.5 µm in space under …, 57 % from z.foot …; 83 % of it …``."""
    at = place_text(worst["position"], ".4g")
    rests = source_words(worst["sources"])
    return (
        f"worst pose of the map: {at}, {length_text(worst['deflection'])} in space under {worst['case']}; "
        f"{in_shares(worst['shares'])}{'; ' + rests if rests else ''}"
    )


def write_map_files(
    result: MapSummary, folder: Path, kinds: Sequence[str], tables: Sequence[str], own_scales: bool
) -> list[Path]:
    """Pictures of the map and of the machine at its worst pose, tables, deviations, report.

    `kinds` are the endings of the pictures; none: no pictures and no report.
    """
    figures = map_figures(result, own_scales) | loaded(result) if kinds else {}
    named = ((f"map-{n}.{kind}", f) for n, f in figures.items() for kind in kinds)
    files = write_files(folder, named)
    files += [write_map_table(result.ds, folder / f"map.{kind}") for kind in tables]
    if result.uncertainty and figures:
        files += write_files(folder, deviation_figures(result.ds, result.plane))
    if figures:
        files.append(write_report(result, folder / "report.html", figures))
    return files


def map_figures(result: MapSummary, own_scales: bool) -> dict[str, Figure]:
    """One picture per reading of the force's direction."""
    from stiffmap.ui.plot import map_figure

    return {
        n: map_figure(
            result.ds, how.variable, case=how.case, tolerance=result.tolerance, common_scale=not own_scales
        )
        for n, how in readings(result.ds, result.plane).items()
    }


def loaded(result: MapSummary) -> dict[str, Figure]:
    """The machine deformed at the worst pose; nothing where there is none, or no stable shape without the load."""
    from stiffmap.ui.plot import loaded_figure

    worst = result.worst
    if worst is None:
        return {}
    try:
        wrench = np.array(worst["wrench"])
        return {"loaded": loaded_figure(result.machine, worst["position"], wrench, gravity=result.gravity)}
    except StiffmapError:
        return {}


def write_report(result: MapSummary, path: Path, figures: dict[str, Figure]) -> Path:
    """The map as one page: its worst pose in words, the table, the pictures."""
    from stiffmap.ui.report.sheet import ReportSheet, write_sheet

    ds, table = result.ds, result.table()
    lost = (
        f"{n} poses have no value: {name.lower().replace('_', ' ')}." for name, n in result.failed.items()
    )
    lines, title = [result.given, *lost, f"{table.title}."], f"Error map of {ds.attrs['machine']}"
    sheet = ReportSheet(title, _answer(result), lines, *as_text(table), numbers=(1, 3, 4, 5, 6))
    captions = {
        "worst": "Deflection where the force points in the worst direction at every position.",
        "best": "Deflection where the force points in the best direction at every position.",
        "loaded": "The machine at its worst pose: without load (dashed), under it (enlarged), and the part of each "
        "spring and drive in the deflection of the tool.",
    }
    pictures = {captions.get(n, f"Deflection under the force {n}."): f for n, f in figures.items()}
    digests = {f"machine {ds.attrs['machine']}, as loaded": ds.attrs["machine_digest"]}
    return write_sheet(path, sheet, pictures, digests)


def _answer(result: MapSummary) -> str:
    """How much of the map keeps the tolerance, and the worst pose."""
    ds, plane = result.ds, result.plane
    size = ds[f"worst_deflection_{plane}"].values
    within = 100 * float((size[np.isfinite(size)] <= result.tolerance).sum() / size.size)
    text = (
        f"Under {ds.attrs['turning_force_N']:g} N in the worst direction of the {plane} plane, {within:.1f} % of the "
        f"positions deflect by less than {1e3 * result.tolerance:g} mm."
    )
    if result.worst is None:
        return text
    told = in_words(result.worst)
    return f"{text} {told[0].upper()}{told[1:]}."

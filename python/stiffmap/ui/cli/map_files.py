"""Files that ``stiffmap map`` writes next to the map: pictures, tables, the report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.cli.map_summary import MapSummary, deviation_figures, in_words
from stiffmap.ui.cli.output import as_text, write_files
from stiffmap.workspace.maps.files import write_map_table
from stiffmap.workspace.maps.summary import readings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    head, rows = as_text(table)
    lines = [
        f"{n} poses have no value: {name.lower().replace('_', ' ')}." for name, n in result.failed.items()
    ]
    sheet = ReportSheet(
        title=f"Error map of {ds.attrs['machine']}",
        answer=_answer(result),
        lines=[result.given, *lines, f"{table.title}."],
        head=head,
        rows=rows,
        numbers=(1, 3, 4, 5, 6),
    )
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

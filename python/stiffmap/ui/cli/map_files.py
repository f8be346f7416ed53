"""Files that ``stiffmap map`` writes next to the map: pictures, tables, the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from rich.table import Table

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import MM
from stiffmap.ui.cli.map_summary import deviation_figures, in_words, readings
from stiffmap.ui.cli.output import as_text, write_files
from stiffmap.workspace.maps.table import write_map_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Wanted:
    """What is asked for next to the map."""

    output: Path
    plane: str
    tolerance: float
    """mm."""
    given: str
    """Force and tolerance, and where they come from."""
    kinds: Sequence[str]
    """Endings of the pictures; none: no pictures and no report."""
    tables: Sequence[str]
    own_scales: bool
    uncertainty: bool


def write_map_files(
    machine: Machine,
    ds: xr.Dataset,
    wanted: Wanted,
    table: Table,
    worst: dict[str, Any] | None,
    failed: dict[str, int],
    gravity: Any = None,
) -> list[Path]:
    """Pictures of the map and of the machine at its worst pose, tables, deviations, report."""
    figures = map_figures(ds, wanted.plane, MM * wanted.tolerance, wanted.own_scales) if wanted.kinds else {}
    figures |= loaded(machine, worst, gravity) if figures and worst is not None else {}
    named = ((f"map-{n}.{kind}", f) for n, f in figures.items() for kind in wanted.kinds)
    files = write_files(wanted.output, named)
    files += [write_map_table(ds, wanted.output / f"map.{kind}") for kind in wanted.tables]
    if wanted.uncertainty and figures:
        files += write_files(wanted.output, deviation_figures(ds, wanted.plane))
    if figures:
        files.append(write_report(ds, wanted, table, worst, failed, figures))
    return files


def map_figures(ds: xr.Dataset, plane: str, tolerance: float, own_scales: bool) -> dict[str, Figure]:
    """One picture per reading of the force's direction."""
    from stiffmap.ui.plot import map_figure

    return {
        n: map_figure(ds, tolerance=tolerance, common_scale=not own_scales, **how)
        for n, how in readings(ds, plane).items()
    }


def loaded(machine: Machine, worst: dict[str, Any], gravity: Any) -> dict[str, Figure]:
    """The machine deformed at the worst pose; nothing where it has no stable shape without the load."""
    from stiffmap.ui.plot import loaded_figure

    try:
        return {
            "loaded": loaded_figure(machine, worst["position"], np.array(worst["wrench"]), gravity=gravity)
        }
    except StiffmapError:
        return {}


def write_report(
    ds: xr.Dataset,
    wanted: Wanted,
    table: Table,
    worst: dict[str, Any] | None,
    failed: dict[str, int],
    figures: dict[str, Figure],
) -> Path:
    """The map as one page: its worst pose in words, the table, the pictures."""
    from stiffmap.ui.report.sheet import Sheet, write_sheet

    head, rows = as_text(table)
    names = {s.name: s.name.lower().replace("_", " ") for s in Status}
    lines = [f"{n} poses have no value: {names[name]}." for name, n in failed.items()]
    sheet = Sheet(
        title=f"Error map of {ds.attrs['machine']}",
        answer=_answer(ds, wanted, worst),
        lines=[wanted.given, *lines, f"{table.title}."],
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
    return write_sheet(wanted.output / "report.html", sheet, pictures, digests)


def _answer(ds: xr.Dataset, wanted: Wanted, worst: dict[str, Any] | None) -> str:
    """How much of the map keeps the tolerance, and the worst pose."""
    size = ds[f"worst_deflection_{wanted.plane}"].values
    within = 100 * float((size[np.isfinite(size)] <= MM * wanted.tolerance).sum() / size.size)
    text = (
        f"Under {ds.attrs['turning_force_N']:g} N in the worst direction of the {wanted.plane} plane, {within:.1f} % of the "
        f"positions deflect by less than {wanted.tolerance:g} mm."
    )
    if worst is None:
        return text
    told = in_words(worst)
    return f"{text} {told[0].upper()}{told[1:]}."

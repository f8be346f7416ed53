"""A map as a table for a spreadsheet: one row per position, mm, µm and degrees."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.common.errors import StiffmapError, needed
from stiffmap.common.outputs import write_rows, writing
from stiffmap.solve.compiled import Status
from stiffmap.solve.labels import COMPONENTS

MICRON, MM = 1e6, 1e3
LONGEST_CELL = 32767  # characters, of Excel
LENGTHS = ("deflection", "worst_deflection", "best_deflection")
ANGLES = ("worst_direction", "best_direction")


def map_table(ds: xr.Dataset) -> tuple[list[str], Iterator[list[Any]]]:
    """Names of the columns with their units, and the rows: position in mm, status in words, each case's displacement (µm, µrad)
    and deflection, then what the map has of worst and best directions; a failed pose has empty cells."""
    full = ds.transpose("z", "y", "x", ...)
    columns: dict[str, Any] = {}
    z, y, x = (np.asarray(full[a].values, dtype=float) for a in "zyx")
    grid = np.meshgrid(z, y, x, indexing="ij")
    for name, values in zip("xyz", reversed(grid), strict=True):
        columns[f"{name}, mm"] = MM * values
    cases = [str(c) for c in full.case.values] if "case" in full.dims else [""]
    for case in cases:
        one = full.sel(case=case) if case else full
        tail = f" {case}" if case else ""
        columns[f"status{tail}"] = np.asarray(one.status.values)
        for k, component in enumerate(COMPONENTS):
            unit = "µm" if k < 3 else "µrad"
            columns[f"{component}{tail}, {unit}"] = MICRON * one.displacement.values[..., k]
        columns |= {f"{n}{tail}, µm": MICRON * v.values for n, v in _like(one, "deflection")}
    for stem in LENGTHS[1:]:
        columns |= {f"{n}, µm": MICRON * v.values for n, v in _like(full, stem)}
    for stem in ANGLES:
        columns |= {f"{n}, deg": np.degrees(v.values) for n, v in _like(full, stem) if v.ndim == 3}
    columns |= {f"{n}, N": v.values for n, v in _like(full, "force_limit")}
    return list(columns), map(list, zip(*(_cells(n, np.ravel(v)) for n, v in columns.items()), strict=True))


def _like(ds: xr.Dataset, stem: str) -> list[tuple[str, Any]]:
    """Variables of one stem: whole, in the plane; not their deviations."""
    names = [str(n) for n in ds.data_vars if n == stem or str(n).startswith(f"{stem}_")]
    return [(n, ds[n]) for n in names if not n.endswith("_std")]


def _cells(name: str, values: Any) -> Iterator[Any]:
    """Of one column (n,)."""
    if name.startswith("status"):
        return (Status(int(v)).name.lower() for v in values)
    return (float(v) if np.isfinite(v) else None for v in values)


def write_map_table(ds: xr.Dataset, path: str | PathLike[str]) -> Path:
    """Write a map as ``.csv`` (UTF-8, comma) or ``.xlsx`` (with a sheet that says what was computed).

    Raises StiffmapError for another ending, FileError where it cannot be written.
    """
    target = Path(path)
    names, rows = map_table(ds)
    if target.suffix == ".csv":
        text = (["" if v is None else f"{v:.9g}" if isinstance(v, float) else v for v in row] for row in rows)
        write_rows(target, names, text, encoding="utf-8-sig")
        return target
    if target.suffix == ".xlsx":
        return _write_xlsx(ds, target, names, rows)
    raise StiffmapError(f"{target.name}: expected .csv or .xlsx")


def _write_xlsx(ds: xr.Dataset, target: Path, names: list[str], rows: Iterator[list[Any]]) -> Path:
    with needed("writing Excel files", "excel"):
        from openpyxl import Workbook
        from openpyxl.cell import WriteOnlyCell
        from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE
    book = Workbook(write_only=True)
    sheet = book.create_sheet("map")
    sheet.freeze_panes = "D2"

    def text(value: str) -> WriteOnlyCell:
        """A cell that is never a formula."""
        cell = WriteOnlyCell(sheet, ILLEGAL_CHARACTERS_RE.sub("�", value))
        cell.data_type = "s"
        return cell

    sheet.append([text(n) for n in names])
    for row in rows:
        sheet.append(row)
    about = book.create_sheet("about")
    for key, value in ds.attrs.items():
        about.append([text(str(key)), text(str(value)[:LONGEST_CELL])])
    with writing(target) as fresh:
        book.save(fresh)
    return target

"""Maps on the disk: NetCDF, or Zarr where the name ends in .zarr; or a table for a spreadsheet, mm, µm and degrees."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from types import ModuleType

import numpy as np
import xarray as xr

from stiffmap.common.errors import FileError, StiffmapError, needed
from stiffmap.common.outputs import needs_space, only_job, put_folder, write_rows, writing
from stiffmap.solve.compiled import Status
from stiffmap.solve.labels import COMPONENTS


def is_zarr(path: Path) -> bool:
    """Whether a name asks for Zarr."""
    return path.suffix == ".zarr"


def write_dataset(ds: xr.Dataset, path: str | PathLike[str]) -> Path:
    """Write a Dataset; what was at `path` is replaced only when the new file is complete.

    Raises FileError where `path` cannot be written.
    """
    target = Path(path)
    needs_space(target, ds.nbytes, "the map")
    if is_zarr(target):
        zarr_package()
        fresh = target.with_name(f".{target.name}.writing")
        with only_job(target), onto_disk(target):
            write_zarr(ds, fresh)
            put_folder(fresh, target)
        return target
    with writing(target) as fresh:
        try:
            ds.to_netcdf(fresh, engine="netcdf4")
        except RuntimeError as error:  # what the NetCDF library says where the disk refuses
            raise FileError(f"cannot be written: {error}; is the disk full?", file=str(target)) from error
    return target


@contextmanager
def onto_disk(path: Path, more: str = "") -> Iterator[None]:
    """FileError where the disk refuses what is written to `path`, with more that is to be said."""
    try:
        yield
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror or error}{more}", file=str(path)) from error


def read_dataset(path: str | PathLike[str]) -> xr.Dataset:
    """Open a written Dataset; values are read when they are used."""
    target = Path(path)
    if not is_zarr(target):
        return xr.open_dataset(target, engine="netcdf4")
    ds = xr.open_zarr(target, consolidated=False)
    return _changed(ds, "T", lambda v: np.array(v.values.tolist(), str).reshape(v.shape))


def write_zarr(ds: xr.Dataset, folder: Path) -> None:
    """With names as strings of any length: the form that Zarr's third format has agreed on."""
    named = _changed(ds, "U", lambda v: v.values.astype(object))
    named.to_zarr(folder, mode="w", zarr_format=3, consolidated=False)


def zarr_package() -> ModuleType:
    """The package zarr; MissingPartError where it is absent."""
    with needed("writing Zarr", "zarr"):
        import zarr
    return zarr


def _changed(ds: xr.Dataset, kind: str, change: Callable[[xr.Variable], np.ndarray]) -> xr.Dataset:
    """The Dataset with the variables and coordinates of one kind of type changed."""
    new = {n: (v.dims, change(v), v.attrs) for n, v in ds.variables.items() if v.dtype.kind == kind}
    out = ds.assign_coords({n: v for n, v in new.items() if n in ds.coords})
    return out.assign({n: v for n, v in new.items() if n not in ds.coords})


def partial_folder(path: Path) -> Path:
    """Folder next to `path` in which an unfinished map grows; made where it is missing."""
    if path.is_dir() and not is_zarr(path):
        raise FileError("cannot be written: it is a folder", file=str(path))
    folder = path.with_name(f"{path.name}.partial")
    with onto_disk(path):
        folder.mkdir(exist_ok=True)
    return folder


MICRON, MM = 1e6, 1e3
LONGEST_CELL = 32767  # characters, of Excel
LENGTHS = ("worst_deflection", "best_deflection")
Cell = str | float | None
ANGLES = ("worst_direction", "best_direction")


def map_table(ds: xr.Dataset) -> tuple[list[str], Iterator[list[Cell]]]:
    """Names of the columns with their units, and the rows: position in mm, status in words, each case's displacement (µm, µrad)
    and deflection, then what the map has of worst and best directions; a failed pose has empty cells."""
    full = ds.transpose("z", "y", "x", ...)
    columns: dict[str, np.ndarray] = {}
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
    for stem in LENGTHS:
        columns |= {f"{n}, µm": MICRON * v.values for n, v in _like(full, stem)}
    for stem in ANGLES:
        columns |= {f"{n}, deg": np.degrees(v.values) for n, v in _like(full, stem) if v.ndim == 3}
    columns |= {f"{n}, N": v.values for n, v in _like(full, "force_limit")}
    return list(columns), map(list, zip(*(_cells(n, np.ravel(v)) for n, v in columns.items()), strict=True))


def _like(ds: xr.Dataset, stem: str) -> list[tuple[str, xr.DataArray]]:
    """Variables of one stem: whole, in the plane; not their deviations."""
    names = [str(n) for n in ds.data_vars if n == stem or str(n).startswith(f"{stem}_")]
    return [(n, ds[n]) for n in names if not n.endswith("_std")]


def _cells(name: str, values: np.ndarray) -> Iterator[Cell]:
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


def _write_xlsx(ds: xr.Dataset, target: Path, names: list[str], rows: Iterator[list[Cell]]) -> Path:
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

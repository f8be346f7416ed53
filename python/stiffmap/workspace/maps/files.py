"""Maps on the disk: NetCDF, or Zarr where the name ends in .zarr."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.common.errors import FileError, needed
from stiffmap.common.outputs import needs_space, only_job, put_folder, writing


def is_zarr(path: Path) -> bool:
    """Whether a name asks for Zarr."""
    return path.suffix == ".zarr"


def write_dataset(ds: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write a Dataset; what was at `path` is replaced only when the new file is complete.

    Raises FileError where `path` cannot be written.
    """
    target = Path(path)
    needs_space(target, ds.nbytes, "the map")
    if is_zarr(target):
        with only_job(target):
            _write_zarr(ds, target)
        return target
    with writing(target) as fresh:
        try:
            ds.to_netcdf(fresh, engine="netcdf4")
        except RuntimeError as error:  # what the NetCDF library says where the disk refuses
            raise FileError(f"cannot be written: {error}; is the disk full?", file=str(target)) from error
    return target


def _write_zarr(ds: xr.Dataset, target: Path) -> None:
    fresh = target.with_name(f".{target.name}.writing")
    zarr_package()
    try:
        write_zarr(ds, fresh)
        put_folder(fresh, target)
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror or error}", file=str(target)) from error


def read_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
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


def zarr_package() -> Any:
    """The package zarr; MissingPartError where it is absent."""
    with needed("writing Zarr", "zarr"):
        import zarr
    return zarr


def _changed(ds: xr.Dataset, kind: str, change: Callable[[xr.Variable], Any]) -> xr.Dataset:
    """The Dataset with the variables and coordinates of one kind of type changed."""
    new = {n: (v.dims, change(v), v.attrs) for n, v in ds.variables.items() if v.dtype.kind == kind}
    out = ds.assign_coords({n: v for n, v in new.items() if n in ds.coords})
    return out.assign({n: v for n, v in new.items() if n not in ds.coords})


def partial_folder(path: Path) -> Path:
    """Folder next to `path` in which an unfinished map grows; made where it is missing."""
    folder = path.with_name(f"{path.name}.partial")
    if path.is_dir() and not is_zarr(path):
        raise FileError("cannot be written: it is a folder", file=str(path))
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror}", file=str(path)) from error
    return folder

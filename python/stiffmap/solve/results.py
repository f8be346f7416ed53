"""Results over poses as labelled arrays, tables, JSON and files: one way for all of them."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from itertools import product
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.json_text import plain
from stiffmap.common.outputs import write_rows, write_text, writing

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

AXES = {3: ("axis", ("x", "y", "z"))}
ENDINGS = (".json", ".csv", ".nc")


class OverPoses:
    """What a result with a ``status`` per pose (leading batch axes (...)) can be converted to; SI."""

    __slots__ = ()
    status: Any

    def to_xarray(self) -> xr.Dataset:
        """Every array as a variable: dimension ``pose``, or ``pose_0``, ``pose_1`` … for several batch axes, then its own."""
        import xarray as xr

        shape = np.shape(self.status)
        batch = ["pose"] if len(shape) == 1 else [f"pose_{i}" for i in range(len(shape))]
        variables: dict[str, Any] = {}
        coordinates: dict[str, Any] = {}
        for name, value in _arrays(self):
            own = value.shape[len(shape) :]
            if value.shape[: len(shape)] != shape:
                continue
            dims = []
            for i, size in enumerate(own):
                dim, labels = AXES.get(size, (f"{name}_{i}", ()))
                dim = dim if dim not in dims else f"{dim}_{i}"
                dims.append(dim)
                if labels:
                    coordinates[dim] = list(labels)
            variables[name] = ([*batch, *dims], value)
        return xr.Dataset(variables, coords=coordinates)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per pose, one column per number: ``dx`` … ``rz`` of the displacement, ``status``, ``compliance_dx_fx`` …."""
        import pandas as pd

        table: dict[str, Any] = {}
        data = self.to_xarray()
        count = data["status"].ndim
        for name, variable in data.data_vars.items():
            shape = variable.shape[:count]
            flat = variable.to_numpy().reshape(int(np.prod(shape)), -1)
            own = variable.dims[count:]
            labels = [data[d].to_numpy() if d in data.coords else range(data.sizes[d]) for d in own]
            first = [] if name == "displacement" and "component" in own else [str(name)]
            for i, parts in enumerate(product(*labels)):
                table["_".join([*first, *map(str, parts)])] = flat[:, i]
        return pd.DataFrame(table)

    def to_json(self) -> str:
        """Every variable of `to_xarray` as nested lists; numbers that are not finite become null."""
        data = {str(n): plain(v.to_numpy()) for n, v in self.to_xarray().data_vars.items()}
        return json.dumps(data, ensure_ascii=False, allow_nan=False)

    def save(self, path: str | PathLike[str]) -> None:
        """Write ``.json``, ``.csv`` or ``.nc`` (NetCDF), as the ending says. StiffmapError for another ending."""
        to = Path(path)
        if to.suffix not in ENDINGS:
            raise StiffmapError(f"{to.name}: expected a name that ends in {', '.join(ENDINGS)}")
        if to.suffix == ".json":
            write_text(to, self.to_json() + "\n")
        elif to.suffix == ".csv":
            table = self.to_dataframe()
            write_rows(to, ["pose", *table.columns], table.itertuples())
        else:
            with writing(to) as fresh:
                self.to_xarray().to_netcdf(fresh, engine="netcdf4")


def _arrays(result: Any) -> list[tuple[str, Any]]:
    """Arrays of a result by name; those of a mapping by ``field.key``."""
    out = []
    for field in fields(result) if is_dataclass(result) else ():
        value = getattr(result, field.name)
        pairs = (
            [(f"{field.name}.{k}", v) for k, v in value.items()]
            if isinstance(value, dict)
            else [(field.name, value)]
        )
        out += [(n, np.asarray(v)) for n, v in pairs if isinstance(v, np.ndarray | np.generic | float | int)]
    return out

"""Answers with names along their axes (xarray), what their variables mean, and results over poses as tables, JSON and files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import product
from math import prod
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffmap.common.broadcasting import given_path, instance_of
from stiffmap.common.errors import StiffmapError
from stiffmap.common.json_text import plain
from stiffmap.common.outputs import write_rows, write_text, writing
from stiffmap.solve.status import Flag, Status

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
TWIST_UNITS = "m (dx, dy, dz), rad (rx, ry, rz)"
COMPLIANCE_UNITS = "m/N, m/(N m), rad/N, rad/(N m): component per wrench_component"
STIFFNESS_UNITS = "N/m, N/rad, N m/m, N m/rad: wrench_component per component"
WRENCH_UNITS = "N (fx, fy, fz), N m (mx, my, mz)"


def meaning(units: str, long_name: str, **more: object) -> dict[str, object]:
    """Attributes of a variable."""
    return {"units": units, "long_name": long_name, **more}


def status_attrs(of: str) -> dict[str, object]:
    """Attributes of a variable of `Status` codes."""
    return meaning(
        "1",
        f"status of {of}",
        flag_values=np.array([int(s) for s in Status], dtype=np.uint8),
        flag_meanings=" ".join(s.name for s in Status),
    )


def flag_attrs() -> dict[str, object]:
    """Attributes of a variable of `Flag` bits."""
    return meaning(
        "1",
        "bits in addition to the status",
        flag_masks=np.array([int(f) for f in Flag], dtype=np.uint32),
        flag_meanings=" ".join(str(f.name) for f in Flag),
    )


def batch_dims(axes: int, dims: Sequence[str] | None = None) -> tuple[str, ...]:
    """Names of the batch axes of an answer; StiffmapError where their number is another."""
    if dims is None:
        return ("pose",) if axes == 1 else tuple(f"pose_{i}" for i in range(axes))
    if isinstance(dims, str) or not isinstance(dims, Sequence) or len(dims) != axes or len(set(dims)) != axes:
        raise StiffmapError(f"dims: expected {axes} different names, one for each batch axis, got {dims!r}")
    return tuple(dims)


def solution_dataset(s: Any, dims: Sequence[str] | None, coords: Mapping[str, Any] | None) -> xr.Dataset:
    """`Solution.to_xarray`."""
    import xarray as xr  # half a second, for tables alone

    b = batch_dims(s.status.ndim, dims)
    displacement = s.displacement
    twist, wrench = ("component",), ("wrench_component",)
    effort = meaning("N or N m", "drive on the leg, positive along the coordinate")
    own: dict[str, Any] = {
        "displacement": (twist, displacement, meaning(TWIST_UNITS, f"displacement of {s.point}")),
        "deflection": (
            (),
            np.linalg.norm(displacement[..., :3], axis=-1),
            meaning("m", "norm of the translation"),
        ),
        "stiffness": (wrench + twist, s.stiffness, meaning(STIFFNESS_UNITS, "loaded stiffness")),
        "compliance": (twist + wrench, s.compliance, meaning(COMPLIANCE_UNITS, "loaded compliance")),
        "status": ((), s.status, status_attrs("the pose under its load")),
        "flags": ((), s.flags, flag_attrs()),
        "iterations": ((), s.iterations, meaning("1", "Newton iterations")),
        "actuator_effort": (("actuator",), s.actuator_effort, effort),
        "leg_wrench": (("leg", *wrench), s.leg_wrench, meaning(WRENCH_UNITS, "leg on platform")),
        "coordinates": (("coordinate",), s.coordinates, meaning("m or rad", "joint and spring coordinates")),
    }
    if s.cables:
        own["tension"] = (("cable",), s.tension, meaning("N", "tension of each cable"))
    data = {name: ((*b, *axes), values, attrs) for name, (axes, values, attrs) in own.items()}
    labels: dict[str, Any] = {
        "component": list(COMPONENTS),
        "wrench_component": list(WRENCH),
        "actuator": list(s.actuators),
        "leg": list(s.legs),
        "coordinate": list(s.coordinate_names),
        **({"cable": list(s.cables)} if s.cables else {}),
    }
    more = {} if coords is None else instance_of(coords, Mapping, "coords", "a mapping name -> coordinate")
    return xr.Dataset(data, coords={**labels, **more}, attrs={"point": s.point})


XYZ, TWISTS, WRENCHES, LEGS = ("axis", ("x", "y", "z")), ("component", COMPONENTS), ("wrench_component", WRENCH), ("leg", ())  # fmt: skip
AXES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "position": (XYZ,), "rotation": (XYZ, ("axis_1", XYZ[1])), "displacement": (TWISTS,), "components": (TWISTS,), "jacobian": (TWISTS,),
    "wrench": (WRENCHES,), "springs": (WRENCHES,), "legs": (WRENCHES,), "leg_wrench": (LEGS, WRENCHES),
    "stiffness": (WRENCHES, TWISTS), "leg_stiffness": (LEGS, WRENCHES, TWISTS),
}  # fmt: skip
"""Field -> its own axes, as far as they have names; all others are numbered, since three drives or modes are no x, y, z."""
OF_THE_MACHINE = ("length", "limits", "errors")  # the same at all poses, however many these are
ENDINGS = (".json", ".csv", ".nc")


class OverPoses:
    """What a result with a ``status`` per pose (leading batch axes (...)) can be converted to; SI."""

    __slots__ = ()
    status: Any

    def to_xarray(self) -> xr.Dataset:
        """Every array as a variable: dimension ``pose``, or ``pose_0``, ``pose_1`` … for several batch axes (none for what is the machine's), then its own."""
        import xarray as xr

        batch = batch_dims(np.ndim(self.status))
        variables: dict[str, Any] = {}
        coordinates: dict[str, Any] = {}
        for name, value in _arrays(self):
            dims = [] if name in OF_THE_MACHINE else list(batch)
            named = AXES.get(name.partition(".")[0], ())
            for i in range(value.ndim - len(dims)):
                dim, labels = named[i] if i < len(named) else (f"{name}_{i}", ())
                dims.append(dim)
                coordinates |= {dim: list(labels)} if labels else {}
            variables[name] = (dims, value)
        return xr.Dataset(variables, coords=coordinates)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per pose, one column per number: ``dx`` … ``rz`` of the displacement, ``status``, ``compliance_dx_fx`` …."""
        import pandas as pd

        table: dict[str, Any] = {}
        data = self.to_xarray()
        batch, shape = data["status"].dims, data["status"].shape
        for name, variable in data.data_vars.items():
            own = {d: n for d, n in variable.sizes.items() if d not in batch}
            flat = np.broadcast_to(variable, (*shape, *own.values())).reshape(prod(shape), prod(own.values()))
            labels = [data[d].to_numpy() if d in data.coords else range(n) for d, n in own.items()]
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
        to = given_path(path, "path")
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

"""What a map consists of, before anything is solved."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.labels import COMPONENTS, WRENCH, meaning
from stiffmap.solve.validity import Validity
from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.maps.loading import Loading
from stiffmap.workspace.maps.provenance import describe
from stiffmap.workspace.maps.uncertainty import METHOD, Uncertain
from stiffmap.workspace.maps.variables import (
    Variable,
    beyond_variable,
    deviation_variables,
    extreme_variables,
    load_variables,
)

EXTREMES = (
    "loaded equilibria in {} directions and at the extremum of the trigonometric polynomial through "
    "their values and slopes; the most extreme one is reported"
)


@dataclass(frozen=True)
class MapPlan:
    """Grid, loads and options of one map."""

    loading: Loading
    x: Floats
    y: Floats
    z: Floats
    wrenches: Floats
    """(cases, 6)."""
    cases: tuple[str, ...] | None
    """None: a single wrench without a name, the map has no case axis."""
    shown_plane: str
    turning: bool
    """Whether the force is turned in the plane."""
    force: float
    directions: int
    tolerance: float
    compliance: bool
    uncertain: Uncertain | None = None

    @property
    def axes(self) -> tuple[int, int]:
        """Base axes of the plane."""
        return plane_axes(self.shown_plane)

    @property
    def shape(self) -> tuple[int, int, int]:
        """(z, y, x)."""
        return (self.z.size, self.y.size, self.x.size)

    @property
    def rows(self) -> int:
        """Rows of the grid, each of all x at one z and y."""
        return self.z.size * self.y.size

    def positions(self, rows: slice) -> Floats:
        """TCP positions (rows * x, 3) of some rows."""
        iz, iy = np.divmod(np.arange(rows.start, rows.stop), self.y.size)
        out = np.empty((iz.size, self.x.size, 3))
        out[..., 0] = self.x
        out[..., 1] = self.y[iy, None]
        out[..., 2] = self.z[iz, None]
        return out.reshape(-1, 3)

    @cached_property
    def validity(self) -> Validity | None:
        """What the readings covered that the machine was calibrated by."""
        return Validity.of_machine(self.loading.machine)

    @cached_property
    def variables(self) -> list[Variable]:
        """The variables that the map will hold."""
        case = () if self.cases is None else ("case",)
        out = load_variables(case, self.shown_plane, self.compliance)
        if self.validity is not None:
            out.append(beyond_variable(case, str(self.validity)))
        if self.uncertain is not None:
            out += deviation_variables(case, self.shown_plane, self.turning)
        return out + (extreme_variables(self.shown_plane, self.tolerance) if self.turning else [])

    @cached_property
    def coords(self) -> dict[str, Any]:
        """Coordinates of the Dataset."""
        out: dict[str, Any] = {
            n: (n, getattr(self, n), meaning("m", f"commanded tcp, base {n} axis")) for n in ("z", "y", "x")
        }
        out["component"] = ("component", np.array(COMPONENTS))
        out["wrench_component"] = ("wrench_component", np.array(WRENCH))
        if self.uncertain is not None:
            out["parameter"] = ("parameter", np.array(self.uncertain.names))
        dims: tuple[str, ...] = ("wrench_component",)
        if self.cases is not None:
            out["case"], dims = ("case", np.array(self.cases)), ("case", *dims)
        w = self.wrenches.reshape([out[d][1].size for d in dims])
        out["wrench"] = (dims, w, meaning("N (fx, fy, fz), N m (mx, my, mz)", "external wrench"))
        return out

    @cached_property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the Dataset."""
        call = {n: getattr(self, n) for n in ("x", "y", "z", "compliance")}
        call |= {"function": "error_map", "wrench": self.wrenches, "cases": self.cases}
        call |= {"plane": self.shown_plane if self.turning else None, "tolerance": self.tolerance}
        if self.uncertain is not None:
            return self._turning_attrs(call | {"uncertainty": True}) | {
                "uncertainty_method": METHOD,
                "uncertainty_left_out": ", ".join(self.uncertain.left_out),
            }
        return self._turning_attrs(call)

    def _turning_attrs(self, call: dict[str, Any]) -> dict[str, Any]:
        if not self.turning:
            return describe(self.loading, "error map", call)
        call |= {"force": self.force, "directions": self.directions}
        out = describe(self.loading, "error map", call)
        return out | {
            "turning_force_N": self.force,
            "turning_force": f"pure forces in the {self.shown_plane} plane at the reference point",
            "extremes_method": EXTREMES.format(self.directions),
            "force_limit_method": "Newton's method on loaded equilibria in the worst direction",
        }

    def dims(self, v: Variable) -> tuple[str, ...]:
        """All dimensions of a variable."""
        return ("z", "y", "x", *v.dims)

    def tail(self, v: Variable) -> tuple[int, ...]:
        """Lengths of a variable's own dimensions."""
        return tuple(self.coords[d][1].size for d in v.dims)

    def dataset(self, arrays: dict[str, Any]) -> xr.Dataset:
        """Label arrays of shape (rows, x, ...)."""
        data = {
            v.name: (self.dims(v), arrays[v.name].reshape(self.shape + self.tail(v)), v.attrs)
            for v in self.variables
        }
        return xr.Dataset(data, self.coords, self.attrs)

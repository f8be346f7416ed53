"""From the arguments of a map to its plan: what it consists of, before anything is solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, names_of, whole_number
from stiffmap.solve.labels import COMPLIANCE_UNITS, COMPONENTS, TWIST_UNITS, WRENCH, meaning, status_attrs
from stiffmap.solve.machine import Machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.solve.validity import Validity
from stiffmap.workspace.maps.inputs import (
    POINTS,
    axis,
    grid_of,
    magnitude,
    plane_axes,
    plane_force,
    wrench_cases,
)
from stiffmap.workspace.maps.loading import Loading, describe, meanings
from stiffmap.workspace.maps.uncertainty import METHOD, Uncertain, uncertain_numbers

BEYOND = "beyond_calibration"


@dataclass(frozen=True)
class Variable:
    """Name, dimensions after those of the grid, type and attributes of one variable."""

    name: str
    dims: tuple[str, ...]
    attrs: dict[str, object]
    dtype: str = "f8"


def load_variables(case: tuple[str, ...], plane: str, compliance: bool) -> list[Variable]:
    """Variables that each load case has."""
    types = {"status": "u1", "flags": "u4"}
    out = [
        Variable(n, (*case, "component") if n == "displacement" else case, attrs, types.get(n, "f8"))
        for n, attrs in meanings(plane, "the pose under its load").items()
    ]
    if compliance:
        dims = (*case, "component", "wrench_component")
        out.append(Variable("compliance", dims, meaning(COMPLIANCE_UNITS, "loaded compliance")))
    return out


def deviation_variables(case: tuple[str, ...], plane: str, turning: bool) -> list[Variable]:
    """Standard deviations of the load cases and of the worst direction."""
    what, share = "standard deviation of ", "share of a number in the variance of the deflection"
    loads = ("deflection", f"deflection_{plane}")
    out = [
        Variable("displacement_std", (*case, "component"), meaning(TWIST_UNITS, f"{what}displacement")),
        *(Variable(f"{n}_std", case, meaning("m", f"{what}{n}")) for n in loads),
        Variable("variance_share", (*case, "parameter"), meaning("1", share)),
    ]
    return out + [Variable(f"worst_{n}_std", (), meaning("m", f"{what}worst_{n}")) for n in loads if turning]


def extreme_variables(plane: str, tolerance: float) -> list[Variable]:
    """Variables over the force directions of a plane; the suffix says which components count."""
    out = [Variable("direction_status", (), status_attrs("the worst of all force directions solved"), "u1")]
    angle = f"direction of that force, from {plane[0]} towards {plane[1]}"
    for suffix, what in (("", "translation"), (f"_{plane}", f"translation in the {plane} plane")):
        for word, size in (("worst", "largest"), ("best", "smallest")):
            text = f"{size} norm of the {what} over the force directions of the {plane} plane"
            out.append(Variable(f"{word}_deflection{suffix}", (), meaning("m", text)))
            out.append(Variable(f"{word}_direction{suffix}", (), meaning("rad", angle, plane=plane)))
        text = f"force in the worst direction at which the norm of the {what} reaches the tolerance"
        out.append(Variable(f"force_limit{suffix}", (), meaning("N", text, tolerance_m=tolerance)))
    return out


EXTREMES = (
    "loaded equilibria in {} directions and at the extremum of the trigonometric polynomial through "
    "their values and slopes; the most extreme one is reported"
)


TILE_POSES = 65536
"""Poses of a tile. It decides the bytes of a Zarr map, so it depends on nothing but the grid."""


def blocks_of(rows: slice, width: int, poses: int) -> list[slice]:
    """Rows cut so that a block has about `poses` poses."""
    step = max(1, poses // width)
    return [slice(i, min(i + step, rows.stop)) for i in range(rows.start, rows.stop, step)]


@dataclass(frozen=True)
class MapPlan:
    """Grid, loads and options of one map."""

    loading: Loading
    x: Floats
    y: Floats
    z: Floats
    wrenches: Floats  # (cases, 6)
    cases: tuple[str, ...] | None  # None: a single wrench without a name, the map has no case axis
    shown_plane: str
    turning: bool  # whether the force is turned in the plane
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

    @cached_property
    def tile_height(self) -> int:
        """Rows of a tile: all x of a part of one z-plane, which is solved, written and done again on its own."""
        return max(1, min(self.y.size, TILE_POSES // self.x.size))

    @cached_property
    def tiles(self) -> list[slice]:
        """Rows of every tile, counted over the whole map."""
        planes = [slice(first, first + self.y.size) for first in range(0, self.rows, self.y.size)]
        return [tile for plane in planes for tile in blocks_of(plane, 1, self.tile_height)]

    def place(self, rows: slice) -> tuple[int, slice]:
        """Plane of a tile, and its rows there (indices of z and y)."""
        plane, first = divmod(rows.start, self.y.size)
        return plane, slice(first, first + rows.stop - rows.start)

    def positions(self, rows: slice) -> Floats:
        """TCP positions (rows * x, 3) of some rows."""
        iz, iy = np.divmod(np.arange(rows.start, rows.stop), self.y.size)
        grid = np.broadcast_arrays(self.x, self.y[iy, None], self.z[iz, None])
        return np.stack(grid, axis=-1).reshape(-1, 3)

    @property
    def case(self) -> tuple[str, ...]:
        """The dimension of the load cases, where there is one."""
        return () if self.cases is None else ("case",)

    @cached_property
    def validity(self) -> Validity | None:
        """What the readings covered that the machine was calibrated by."""
        return Validity.of_machine(self.loading.machine)

    @cached_property
    def variables(self) -> list[Variable]:
        """The variables that the map will hold."""
        case = self.case
        out = load_variables(case, self.shown_plane, self.compliance)
        if self.validity is not None:
            text = "1: joints or load are beyond the readings that the machine was calibrated by"
            attrs = meaning("1", text, calibrated_by=str(self.validity))
            out.append(Variable(BEYOND, case, attrs, "u1"))
        if self.uncertain is not None:
            out += deviation_variables(case, self.shown_plane, self.turning)
        return out + (extreme_variables(self.shown_plane, self.tolerance) if self.turning else [])

    @cached_property
    def coords(self) -> dict[str, xr.Variable]:
        """Coordinates of the Dataset."""
        names: dict[str, Sequence[str]] = {"component": COMPONENTS, "wrench_component": WRENCH}
        if self.uncertain is not None:
            names["parameter"] = self.uncertain.names
        if self.cases is not None:
            names["case"] = self.cases
        out = {
            n: xr.Variable(n, getattr(self, n), meaning("m", f"commanded tcp, base {n} axis")) for n in "zyx"
        } | {n: xr.Variable(n, np.array(values)) for n, values in names.items()}
        dims = (*self.case, "wrench_component")
        w = self.wrenches.reshape([out[d].size for d in dims])
        meant = meaning("N (fx, fy, fz), N m (mx, my, mz)", "external wrench")
        return out | {"wrench": xr.Variable(dims, w, meant)}

    @cached_property
    def attrs(self) -> dict[str, object]:
        """Attributes of the Dataset."""
        call: dict[str, object] = {
            "x": self.x, "y": self.y, "z": self.z, "compliance": self.compliance, "function": "error_map",
            "wrench": self.wrenches, "cases": self.cases, "plane": self.shown_plane if self.turning else None,
            "tolerance": self.tolerance,
        }  # fmt: skip
        call |= {"uncertainty": True} if self.uncertain is not None else {}
        call |= {"force": self.force, "directions": self.directions} if self.turning else {}
        out = describe(self.loading, "error map", call)
        if self.turning:
            out |= {
                "turning_force_N": self.force,
                "turning_force": f"pure forces in the {self.shown_plane} plane at the reference point",
                "extremes_method": EXTREMES.format(self.directions),
                "force_limit_method": "Newton's method on loaded equilibria in the worst direction",
            }
        if self.uncertain is not None:
            out["uncertainty_method"] = METHOD
            out["uncertainty_left_out"] = ", ".join(self.uncertain.left_out)
        return out

    def dims(self, v: Variable) -> tuple[str, ...]:
        """All dimensions of a variable."""
        return ("z", "y", "x", *v.dims)

    def tail(self, v: Variable) -> tuple[int, ...]:
        """Lengths of a variable's own dimensions."""
        return tuple(self.coords[d].size for d in v.dims)

    def dataset(self, arrays: dict[str, np.ndarray]) -> xr.Dataset:
        """Label arrays of shape (rows, x, ...)."""
        data = {
            v.name: (self.dims(v), arrays[v.name].reshape(self.shape + self.tail(v)), v.attrs)
            for v in self.variables
        }
        return xr.Dataset(data, self.coords, self.attrs)


@spelled_out(LoadingKeywords)
def map_plan(
    machine: Machine,
    *,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    z: ArrayLike | None = None,
    points: int = POINTS,
    wrench: ArrayLike | Mapping[str, ArrayLike] | None = None,
    cases: Sequence[str] | None = None,
    plane: str | None = "xy",
    force: float | None = None,
    directions: int = 4,
    tolerance: float = 0.25e-3,
    compliance: bool = False,
    uncertainty: bool = False,
    **how: Unpack[LoadingKeywords],
) -> MapPlan:
    """The plan of `stiffmap.error_map` with these arguments; `how`: the fields of `Loading`.

    Raises StiffmapError for bad input.
    """
    loading = Loading(machine, **how)
    grid = grid_of(machine, {"x": x, "y": y, "z": z}, points)
    wrenches, names = wrench_cases(wrench, None if cases is None else names_of(cases, "cases"))
    directions = whole_number(directions, "directions", 3)
    x, y, z = (axis(grid[a], a) for a in "xyz")
    return MapPlan(
        loading, x, y, z, wrenches, names,
        shown_plane="xy" if plane is None else "".join("xyz"[i] for i in plane_axes(plane)), turning=plane is not None,
        directions=directions, tolerance=magnitude(tolerance, "tolerance", "m"), compliance=compliance,
        uncertain=uncertain_numbers(machine) if uncertainty else None,
        force=0.0 if plane is None else plane_force(wrenches, force),  # last: who gives none may not have meant to
    )  # fmt: skip

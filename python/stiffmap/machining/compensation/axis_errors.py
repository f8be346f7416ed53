"""Errors of the tool along one axis in the terms of ISO 230-1: what a compensation table of a controller holds.

With the tool commanded along X, E_XX is the deviation of its position (actual less commanded) along X, E_YX and
E_ZX along Y and Z (straightness), E_AX, E_BX, E_CX its rotations about X, Y and Z; so for Y and Z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, one_of, real_array, refused
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.compensation.commands import compensate
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.maps.files import read_dataset
from stiffmap.workspace.maps.inputs import place, rising

LETTERS = "XYZABC"


@dataclass(frozen=True, eq=False)
class AxisErrors:
    """Errors along one axis at rising commanded positions, SI, base axes."""

    axis: str
    """x, y or z: the direction of travel."""
    position: Floats
    """(n,) m, commanded coordinate along the axis."""
    forward: Floats
    """(n, 6) m, rad: errors on arriving in the positive direction."""
    backward: Floats
    """(n, 6) the same in the negative direction."""
    interpolation: float
    """m: what linear interpolation between the positions leaves of the positioning error, at most."""
    interpolation_checked: bool = True
    """Solved half way between the positions; False: estimated from their second differences."""
    through: tuple[float, ...] = (0.0, 0.0, 0.0)
    """m: a point of the line; its coordinate along the axis does not count."""
    machine: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the six columns: E_XX, E_YX … for travel along x."""
        return tuple(f"E_{letter}{self.axis.upper()}" for letter in LETTERS)

    @property
    def positioning(self) -> tuple[Floats, Floats]:
        """(n,) m forward and backward: the error along the axis itself."""
        i = "xyz".index(self.axis)
        return self.forward[:, i], self.backward[:, i]

    @property
    def reversal(self) -> Floats:
        """(n,) m, the reversal value of ISO 230-2: forward less backward."""
        forward, backward = self.positioning
        return np.asarray(forward - backward)

    def zeroed(self, at: float) -> AxisErrors:
        """Less the mean of both directions at position `at` (m), where a controller has its reference point."""
        if not self.position[0] <= at <= self.position[-1]:
            raise StiffmapError(f"zero: {1e3 * at:g} mm lies outside the table")
        mean = (self.forward + self.backward) / 2
        there = np.array([np.interp(at, self.position, mean[:, k]) for k in range(6)])
        return replace(self, forward=self.forward - there, backward=self.backward - there)

    def corrected(self, command: ArrayLike, *, forward: bool = True) -> Floats:
        """Commanded coordinates (m) that a controller with this table sends: less the interpolated error."""
        u = real_array(command, "command")
        error = self.positioning[0 if forward else 1]
        return np.asarray(u - np.interp(u, self.position, error))


@takes_machine
def axis_errors(
    machine: Machine,
    axis: str,
    position: ArrayLike | None = None,
    *,
    points: int = 21,
    through: ArrayLike | None = None,
    zero: float | None = None,
    wrench: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> AxisErrors:
    """Errors of a corrected machine (its effects, weight and load) along one axis, in both directions of travel.

    position: (n,) m commanded along `axis`, None: `points` over the workspace; through: (3,) m a point of the line, None: home;
    zero: m, position of the reference point, where the table is zero, None: none;
    wrench: (6,) N, N·m at the tool; gravity: (3,) m/s², None: the machine's. Between the positions the errors are
    solved as well, for `interpolation`. Raises StiffmapError where a position has no answer.
    """
    i = "xyz".index(one_of(axis, ("x", "y", "z"), "axis"))
    if axis not in machine.description.task:
        raise StiffmapError(f"axis: {machine.name} does not command {axis}")
    if position is None:
        low, high = machine.workspace
        position = np.linspace(low[i], high[i], max(points, 1))
    name, expected = "points, position", "two or more rising numbers (m)"
    nodes = rising(position, name, expected)
    if nodes.size < 2:
        raise refused(name, expected, "one")
    point = place(machine.description.home.p if through is None else through, "through")
    middle = (nodes[:-1] + nodes[1:]) / 2
    everywhere = np.r_[nodes, middle]
    line = np.tile(point, (everywhere.size, 1))
    line[:, i] = everywhere
    errors = []
    for sense in (1.0, -1.0):
        way = sense * np.eye(3)[i]
        found = compensate(machine, line, wrench=wrench, approach=way, gravity=gravity)
        if not np.isfinite(found.before).all():
            lost = everywhere[~np.isfinite(found.before).all(axis=1)][0]
            raise StiffmapError(f"{axis} = {1e3 * lost:g} mm: the machine has no answer there")
        errors.append(found.before)
    n = nodes.size
    half_way = [e[n:, i] - (e[: n - 1, i] + e[1:n, i]) / 2 for e in errors]
    made = AxisErrors(
        axis,
        nodes,
        errors[0][:n],
        errors[1][:n],
        float(np.abs(half_way).max()),
        through=tuple(point.tolist()),
        machine=machine.name,
    )
    return made if zero is None else made.zeroed(zero)


def axis_errors_of_map(
    ds: xr.Dataset | str | PathLike[str],
    axis: str,
    *,
    through: ArrayLike | None = None,
    case: str | None = None,
    zero: float | None = None,
) -> AxisErrors:
    """The same from an error map (dataset, .nc or .zarr): its displacement along the line of the grid nearest to `through` (3,) m.

    case: load case of the map; None: its only one. Both directions of travel are the same. The interpolation error
    is estimated from second differences.
    """
    i = "xyz".index(one_of(axis, ("x", "y", "z"), "axis"))
    if not isinstance(ds, xr.Dataset):
        ds = read_dataset(ds)
    if "case" in ds.dims:
        names = [str(c) for c in ds.case.values]
        if (case is None and len(names) > 1) or (case is not None and case not in names):
            found = "" if case is None else f", got '{case}'"
            raise StiffmapError(f"case: expected one of {', '.join(names)}{found}")
        ds = ds.sel(case=case or names[0])
    middle = [float(ds[a].values[ds[a].size // 2]) for a in "xyz"]
    point = middle if through is None else place(through, "through").tolist()
    others = {a: point[k] for k, a in enumerate("xyz") if k != i}
    line = ds.sel(others, method="nearest").sortby(axis)
    nodes = np.asarray(line[axis].values, dtype=float)
    errors = np.asarray(line.displacement.transpose(axis, "component").values, dtype=float)
    if nodes.size < 3:
        raise StiffmapError(f"the map has {nodes.size} positions along {axis}; a table needs three or more")
    if not np.isfinite(errors).all():
        lost = nodes[~np.isfinite(errors).all(axis=1)][0]
        raise StiffmapError(f"{axis} = {1e3 * lost:g} mm: the map has no answer there")
    bend = errors[1:-1, i] - (
        errors[:-2, i] * (nodes[2:] - nodes[1:-1]) + errors[2:, i] * (nodes[1:-1] - nodes[:-2])
    ) / (nodes[2:] - nodes[:-2])
    at = tuple(float(nodes[0] if k == i else line[a]) for k, a in enumerate("xyz"))
    made = AxisErrors(
        axis,
        nodes,
        errors,
        errors.copy(),
        float(np.abs(bend).max()) / 4,  # a linear interpolant over half the step
        interpolation_checked=False,
        through=at,
        machine=str(ds.attrs.get("machine", "")),
    )
    return made if zero is None else made.zeroed(zero)

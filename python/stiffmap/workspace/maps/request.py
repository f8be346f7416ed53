"""From the arguments of a map to its plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import instance_of, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.workspace.maps.inputs import axis, magnitude, plane_axes, plane_force, wrench_cases
from stiffmap.workspace.maps.loading import Loading
from stiffmap.workspace.maps.plan import MapPlan
from stiffmap.workspace.maps.uncertainty import uncertain_numbers
from stiffmap.workspace.maps.workspace_grid import grid_of


@spelled_out(LoadingKeywords)
def map_plan(
    machine: Machine,
    *,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    z: ArrayLike | None = None,
    wrench: ArrayLike | Mapping[str, ArrayLike] | None = None,
    cases: Sequence[str] | None = None,
    plane: str | None = "xy",
    force: float | None = None,
    directions: int = 4,
    tolerance: float = 0.25e-3,
    compliance: bool = False,
    uncertainty: bool = False,
    **how: Any,
) -> MapPlan:
    """The plan of `stiffmap.error_map` with these arguments; `how`: the fields of `Loading`.

    Raises StiffmapError for bad input.
    """
    loading = Loading(machine, **how)
    grid = grid_of(machine, {"x": x, "y": y, "z": z})
    instance_of(compliance, (bool, np.bool_), "compliance", "True or False")
    wrenches, names = wrench_cases(wrench, None if cases is None else tuple(cases))
    if (directions := whole_number(directions, "directions", 1)) < 3:
        raise StiffmapError(f"directions: expected 3 or more, got {directions}")
    return MapPlan(
        loading=loading,
        x=axis(grid["x"], "x"),
        y=axis(grid["y"], "y"),
        z=axis(grid["z"], "z"),
        wrenches=wrenches,
        cases=names,
        shown_plane="xy" if plane is None else "".join("xyz"[i] for i in plane_axes(plane)),
        turning=plane is not None,
        force=0.0 if plane is None else plane_force(wrenches, force),
        directions=directions,
        tolerance=magnitude(tolerance, "tolerance", "m"),
        compliance=compliance,
        uncertain=uncertain_numbers(machine) if uncertainty else None,
    )

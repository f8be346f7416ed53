"""`stiffmap.polar`."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import whole_number
from stiffmap.solve.labels import meaning
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.workspace.maps.extremes import (
    DirectionSweep,
    TurningForce,
    direction,
    direction_sweep_of,
    even_angles,
)
from stiffmap.workspace.maps.inputs import magnitude, place, plane_axes
from stiffmap.workspace.maps.loading import Loading, at_place, describe, displaced, without_failed


@takes_machine
@spelled_out(LoadingKeywords)
def polar(
    machine: Machine,
    position: ArrayLike,
    force: float = 300.0,
    plane: str = "xy",
    *,
    directions: int = 72,
    **given: Unpack[LoadingKeywords],
) -> xr.Dataset:
    """Deflection against the direction of a pure force in a plane, at one position.

    position (3,) m; force N; `directions` equally spaced directions from the plane's first axis
    towards its second, each a loaded equilibrium. Other keywords as in `Machine.solve`.

    Returns a Dataset with dimension ``angle`` (rad): displacement, deflection, deflection_xy, status,
    flags, and the scalars worst_deflection, worst_direction, best_deflection, best_direction (whole
    translation; with ``_xy`` in the plane) searched between the directions. Failed directions hold NaN
    and their status. Raises StiffmapError for bad input.
    """
    loading = Loading(machine, **given)
    p, axes = place(position), plane_axes(plane)
    force = magnitude(force, "force", "N")
    directions = whole_number(directions, "directions", 3)
    angle = even_angles(directions)
    wrench = np.concatenate([force * direction(angle, axes), np.zeros((directions, 3))], axis=1)
    s = loading.solve(p[None, None], wrench[None])
    swept = direction_sweep_of(s, angle[None], np.full((1, directions), force), axes)
    turning = TurningForce(loading, p[None], force, axes)
    d = without_failed(s.displacement, s.status)[0]
    data = displaced("angle", d, s.status[0], s.flags[0], plane) | _extremes(turning, plane, swept)
    coords = at_place(p) | {
        "angle": (
            "angle",
            angle,
            meaning("rad", f"direction of the force, from {plane[0]} towards {plane[1]}"),
        ),
        "force": ((), force, meaning("N", "magnitude of the force")),
    }
    call = {"function": "polar", "position": p, "force": force, "plane": plane, "directions": directions}
    return xr.Dataset(data, coords, describe(loading, "polar diagram", call))


def _extremes(force: TurningForce, plane: str, swept: DirectionSweep) -> dict[str, Any]:
    out = {}
    for suffix, _, worst, best in force.extremes(swept, plane):
        for word, size, e in (("worst", "largest", worst), ("best", "smallest", best)):
            what = f"{size} deflection over the force directions of the {plane} plane"
            out[f"{word}_deflection{suffix}"] = ((), e.value[0], meaning("m", what))
            out[f"{word}_direction{suffix}"] = ((), e.angle[0], meaning("rad", "direction of that force"))
    return out

"""The path of equilibria under a growing force, past limit points, with buckling loads and modes."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from stiffmap.broadcasting import Floats
from stiffmap.compiled.machine import PATH_CONTROLS as CONTROLS
from stiffmap.errors import StiffmapError
from stiffmap.machine import hint_metres
from stiffmap.maps.critical import critical_variables
from stiffmap.maps.fixed_order_sums import norm
from stiffmap.maps.loading import Loading
from stiffmap.maps.provenance import describe
from stiffmap.maps.variables import COMPONENTS, TWIST_UNITS, meaning, status_attrs
from stiffmap.status import Status

BRANCH = meaning("1", "0: the path from rest; 1: the branch that crosses it")
UNITS = {"force": "N", "displacement": "m", "arc": "m"}
ENDS = (
    "the limit was reached",
    "the commanded pose is out of reach",
    "singular without load",
    "no further equilibrium was found",
    "the largest number of points was listed",
    "the force fell to zero",
    "not followed",
)
"""In the order of the core's reasons why a branch ends."""


def load_path(
    loading: Loading, position: Floats, direction: Floats, control: str, limit: float, steps: int, cross: int
) -> xr.Dataset:
    """See `sweep`: what it does with a `limit`."""
    machine, options = loading.machine, loading.options
    if options.point not in machine.points:
        raise StiffmapError(f"point: expected one of {', '.join(machine.points)}, got {options.point!r}")
    turned = machine.compiled.home_rotation if options.rotation is None else options.rotation
    flags, *branches = machine.compiled.path(
        position,
        np.ascontiguousarray(turned, dtype=float),
        direction,
        point=options.point,
        gravity=np.array(loading.acting_gravity()),
        control=control,
        limit=limit,
        steps=steps,
        cross=cross,
    )
    (end, points, critical), (crossing_end, crossing, crossing_critical) = branches
    hint_metres(machine, position, not points)
    _check_cross(cross, critical, str(ENDS[end]))
    call = {"function": "sweep", "position": position, "direction": direction, "control": control,
            "limit": limit, "steps": steps, "cross": cross}  # fmt: skip
    attrs = describe(loading, f"load path by {control}", call) | {
        "end": ENDS[end],
        "crossing_end": _crossing_end(cross, critical, crossing, ENDS[crossing_end]),
        "flags": int(flags),
        "critical_points": json.dumps([_summary(c) for c in critical]),
    }
    data, coords = _variables(points + crossing)
    data["branch"] = ("step", [0] * len(points) + [1] * len(crossing), BRANCH)
    modes, mode_coords = critical_variables(machine, critical + crossing_critical)
    modes["critical_branch"] = ("critical", [0] * len(critical) + [1] * len(crossing_critical), BRANCH)
    coords |= mode_coords | {
        "axis": ("axis", np.array(["x", "y", "z"])),
        "position": ("axis", position, meaning("m", "commanded tcp")),
        "direction": ("axis", direction, meaning("1", "direction of the force, base axes")),
    }
    return xr.Dataset(data | modes, coords, attrs)


def _crossing_end(cross: int, critical: list[dict[str, Any]], points: list[Any], end: str) -> str:
    """Why it ended; at its first point, where several modes leave no single branch to follow."""
    if cross and len(points) == 1:
        fork = [c for c in critical if not c["limit"]][abs(cross) - 1]
        if abs(fork["after"] - fork["before"]) > 1:
            return f"not followed: {abs(fork['after'] - fork['before'])} modes at once, no single branch"
    return end


def _check_cross(cross: int, critical: list[dict[str, Any]], end: str) -> None:
    forks = sum(not c["limit"] for c in critical)
    if abs(cross) > forks:
        raise StiffmapError(f"cross: the path has {forks} bifurcations, got {cross} (end of the path: {end})")


def check_control(control: str, limit: float | None, steps: int, load_type: object, cross: int) -> float:
    """The limit as a number; StiffmapError where the options do not fit together."""
    if control not in CONTROLS:
        raise StiffmapError(f"control: expected one of {', '.join(CONTROLS)}, got {control!r}")
    if limit is None or not np.isfinite(limit) or limit == 0:
        raise StiffmapError(
            f"limit: expected a number other than 0 ({UNITS[control]} for control {control!r}), got {limit!r}"
        )
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
        raise StiffmapError(f"steps: expected a positive number, got {steps!r}")
    if isinstance(cross, bool) or not isinstance(cross, int):
        raise StiffmapError(f"cross: expected the number of a bifurcation, 1, -1, 2 …, got {cross!r}")
    if load_type != "dead":
        raise StiffmapError(f"load_type: a path needs a conservative force, 'dead'; got {load_type!r}")
    return float(limit)


def _variables(points: list[dict[str, Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    displacement = np.array([p["displacement"] for p in points]).reshape(-1, 6)
    force = np.array([p["load"] for p in points])
    unstable = np.array([p["unstable"] for p in points], dtype=int)
    status = np.where(unstable > 0, Status.UNSTABLE, Status.CONVERGED).astype(np.uint8)
    return {
        "displacement": (
            ("step", "component"),
            displacement,
            meaning(TWIST_UNITS, "displacement of the reference point"),
        ),
        "deflection": ("step", norm(displacement[:, :3]), meaning("m", "norm of the translation")),
        "deflection_xy": ("step", norm(displacement[:, :2]), meaning("m", "norm in the xy plane")),
        "deflection_along": (
            "step",
            np.array([p["along"] for p in points]),
            meaning("m", "translation along the force"),
        ),
        "unstable_modes": ("step", unstable, meaning("1", "directions in which the energy falls")),
        "status": ("step", status, status_attrs("the equilibrium")),
    }, {
        "force": ("step", force, meaning("N", "force along the direction")),
        "component": ("component", np.array(COMPONENTS)),
    }


def _summary(c: dict[str, Any]) -> dict[str, Any]:
    kind = "limit" if c["limit"] else "bifurcation"
    return {"kind": kind, "force": c["load"], "deflection_along": c["along"]}

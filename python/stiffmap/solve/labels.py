"""Answers with names along their axes (xarray), and what their variables mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.status import Flag, Status

if TYPE_CHECKING:
    import xarray as xr

COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
TWIST_UNITS = "m (dx, dy, dz), rad (rx, ry, rz)"
COMPLIANCE_UNITS = "m/N, m/(N m), rad/N, rad/(N m): component per wrench_component"
STIFFNESS_UNITS = "N/m, N/rad, N m/m, N m/rad: wrench_component per component"
WRENCH_UNITS = "N (fx, fy, fz), N m (mx, my, mz)"


def meaning(units: str, long_name: str, **more: Any) -> dict[str, Any]:
    """Attributes of a variable."""
    return {"units": units, "long_name": long_name, **more}


def status_attrs(of: str) -> dict[str, Any]:
    """Attributes of a variable of `Status` codes."""
    return meaning(
        "1",
        f"status of {of}",
        flag_values=np.array([int(s) for s in Status], dtype=np.uint8),
        flag_meanings=" ".join(s.name for s in Status),
    )


def flag_attrs() -> dict[str, Any]:
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
    if isinstance(dims, str) or len(dims) != axes or len(set(dims)) != axes:
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
    return xr.Dataset(data, coords={**labels, **(coords or {})}, attrs={"point": s.point})

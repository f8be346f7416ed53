"""Speed of the tool that the drives reach in every direction of a plane (hexagon, Figure 1c)."""

from __future__ import annotations

from stiffmap.workspace.maps.inputs import plane_axes
from stiffmap.workspace.performance.motion.polygons import inner_radius
from stiffmap.workspace.performance.motion.scaling import drive_values
from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case) -> Found:
    """Over all poses of the box, drives within the speeds that the machine file declares."""
    speeds = drive_values(case.machine, "speed", None, "m/s or rad/s")
    rates = case.inverse[..., list(plane_axes(case.plane))]
    return over_poses(case.positions, inner_radius(rates, speeds), "high")


MEASURE = Measure(
    "velocity", "speed in every direction of the plane", "m/s", "high", compute, "m/min", 60.0, order=20
)

"""Performance measures of §3 of the paper, for every machine that a file can describe (docs/measures.md)."""

from stiffmap.workspace.performance.box.box import largest_box
from stiffmap.workspace.performance.box.workspace import workspace_volume
from stiffmap.workspace.performance.limits.deflection import worst_deflection
from stiffmap.workspace.performance.motion.closing import drive_kinematics
from stiffmap.workspace.performance.motion.efforts import drive_efforts, peak_acceleration
from stiffmap.workspace.performance.motion.force import accuracy_transmission, force_transmission
from stiffmap.workspace.performance.motion.inertia import moving_mass, natural_frequencies, total_mass
from stiffmap.workspace.performance.motion.motion_files import Motion, load_motion
from stiffmap.workspace.performance.motion.timing import fastest
from stiffmap.workspace.performance.motion.trajectory import (
    Trajectory,
    circle,
    line,
    read_points,
    through,
    timed,
)
from stiffmap.workspace.performance.motion.velocity import velocity_section, velocity_transmission
from stiffmap.workspace.performance.pieces import in_pieces
from stiffmap.workspace.performance.requirements import load_requirements
from stiffmap.workspace.performance.table import MeasuresTable, measures

__all__ = [
    "MeasuresTable",
    "Motion",
    "Trajectory",
    "accuracy_transmission",
    "circle",
    "drive_efforts",
    "drive_kinematics",
    "fastest",
    "force_transmission",
    "in_pieces",
    "largest_box",
    "line",
    "load_motion",
    "load_requirements",
    "measures",
    "moving_mass",
    "natural_frequencies",
    "peak_acceleration",
    "read_points",
    "through",
    "timed",
    "total_mass",
    "velocity_section",
    "velocity_transmission",
    "workspace_volume",
    "worst_deflection",
]

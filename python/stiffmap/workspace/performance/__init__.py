"""Performance measures of §3 of the paper, for every machine that a file can describe (docs/measures.md)."""

from stiffmap.workspace.performance.box.box import LargestBox, largest_box
from stiffmap.workspace.performance.box.workspace import Workspace, workspace_volume
from stiffmap.workspace.performance.limits.deflection import WorstDeflection, worst_deflection
from stiffmap.workspace.performance.motion.closing import DriveKinematics, drive_kinematics
from stiffmap.workspace.performance.motion.efforts import (
    PeakAcceleration,
    drive_efforts,
    peak_acceleration,
)
from stiffmap.workspace.performance.motion.force import (
    AccuracyTransmission,
    ForceTransmission,
    accuracy_transmission,
    force_transmission,
)
from stiffmap.workspace.performance.motion.inertia import (
    NaturalFrequencies,
    body_masses,
    moving_mass,
    natural_frequencies,
    total_mass,
)
from stiffmap.workspace.performance.motion.motion_files import Motion, load_motion
from stiffmap.workspace.performance.motion.timing import fastest
from stiffmap.workspace.performance.motion.trajectory import (
    Path,
    Trajectory,
    circle,
    line,
    read_points,
    through,
    timed,
)
from stiffmap.workspace.performance.motion.velocity import (
    VelocityTransmission,
    velocity_section,
    velocity_transmission,
)
from stiffmap.workspace.performance.pieces import in_pieces
from stiffmap.workspace.performance.requirements import Requirements, load_requirements
from stiffmap.workspace.performance.table import MeasuresTable, measures

__all__ = [
    "AccuracyTransmission",
    "DriveKinematics",
    "ForceTransmission",
    "LargestBox",
    "MeasuresTable",
    "Motion",
    "NaturalFrequencies",
    "Path",
    "PeakAcceleration",
    "Requirements",
    "Trajectory",
    "VelocityTransmission",
    "Workspace",
    "WorstDeflection",
    "accuracy_transmission",
    "body_masses",
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

"""Performance measures of §3 of the paper, for every machine that a file can describe (docs/measures.md)."""

from stiffmap.performance.accuracy import AccuracyTransmission, accuracy_transmission
from stiffmap.performance.box import LargestBox, largest_box
from stiffmap.performance.closing import DriveKinematics, drive_kinematics
from stiffmap.performance.deflection import WorstDeflection, worst_deflection
from stiffmap.performance.efforts import PeakAcceleration, drive_efforts, fastest, peak_acceleration
from stiffmap.performance.force import ForceTransmission, force_transmission
from stiffmap.performance.frequencies import NaturalFrequencies, natural_frequencies
from stiffmap.performance.inertia import body_masses, moving_mass, total_mass
from stiffmap.performance.motion_files import Motion, load_motion
from stiffmap.performance.pieces import in_pieces
from stiffmap.performance.requirements import Requirements, load_requirements
from stiffmap.performance.table import MeasuresTable, measures
from stiffmap.performance.trajectory import Path, Trajectory, circle, line, read_points, through, timed
from stiffmap.performance.velocity import VelocityTransmission, velocity_section, velocity_transmission
from stiffmap.performance.workspace import Workspace, workspace_volume

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

"""Performance measures of §3 of the paper, for every machine that a file can describe (docs/measures.md)."""

from stiffmap.workspace.performance.box.box import largest_box
from stiffmap.workspace.performance.box.workspace import workspace_volume
from stiffmap.workspace.performance.limits.deflection import worst_deflection
from stiffmap.workspace.performance.motion.efforts import drive_efforts, force_transmission
from stiffmap.workspace.performance.motion.inertia import natural_frequencies
from stiffmap.workspace.performance.motion.motion_files import load_motion
from stiffmap.workspace.performance.motion.trajectory import circle, fastest, line, through, timed
from stiffmap.workspace.performance.motion.velocity import (
    accuracy_transmission,
    velocity_section,
    velocity_transmission,
)
from stiffmap.workspace.performance.pieces import in_pieces
from stiffmap.workspace.performance.requirements import load_requirements
from stiffmap.workspace.performance.table import MeasuresTable, measures

__all__ = [
    "MeasuresTable", "accuracy_transmission", "circle", "drive_efforts", "fastest", "force_transmission",
    "in_pieces", "largest_box", "line", "load_motion", "load_requirements", "measures", "natural_frequencies",
    "through", "timed", "velocity_section", "velocity_transmission", "workspace_volume", "worst_deflection",
]  # fmt: skip

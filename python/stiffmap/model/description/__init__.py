"""The immutable description of a machine: what it is made of, in SI units, with no numerics."""

from stiffmap.model.description.elements import (
    BeamNumbers,
    Block,
    Body,
    Branch,
    Cable,
    Drive,
    Element,
    Joint,
    Offset,
    Point,
    Spring,
)
from stiffmap.model.description.laws import CommandError, GuideError, JointFriction, Law
from stiffmap.model.description.machine import TASK, AppliedEffect, ExternalSpring, Leg, MachineDescription
from stiffmap.model.description.pose import Pose
from stiffmap.model.description.strokes import BeamStroke, TableStroke

__all__ = [
    "TASK", "AppliedEffect", "BeamNumbers", "BeamStroke", "Block", "Body", "Branch", "Cable",
    "CommandError", "Drive", "Element", "ExternalSpring", "GuideError", "Joint", "JointFriction", "Law",
    "Leg", "MachineDescription", "Offset", "Point", "Pose", "Spring", "TableStroke",
]  # fmt: skip

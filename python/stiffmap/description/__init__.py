"""The immutable description of a machine: what it is made of, in SI units, with no numerics."""

from stiffmap.description.beam import BeamNumbers
from stiffmap.description.elements import (
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
from stiffmap.description.laws import CommandError, GuideError, JointFriction, Law
from stiffmap.description.machine import (
    TASK,
    AppliedEffect,
    ExternalSpring,
    Leg,
    MachineDescription,
)
from stiffmap.description.pose import Pose
from stiffmap.description.strokes import BeamStroke, TableStroke

__all__ = [
    "TASK",
    "AppliedEffect",
    "BeamNumbers",
    "BeamStroke",
    "Block",
    "Body",
    "Branch",
    "Cable",
    "CommandError",
    "Drive",
    "Element",
    "ExternalSpring",
    "GuideError",
    "Joint",
    "JointFriction",
    "Law",
    "Leg",
    "MachineDescription",
    "Offset",
    "Point",
    "Pose",
    "Spring",
    "TableStroke",
]

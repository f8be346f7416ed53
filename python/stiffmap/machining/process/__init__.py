"""Processes: a tool, a law of its cutting force, speeds and a cut; forces from them, and laws from measured forces."""

from stiffmap.machining.process.description import EndMill, Kienzle, Process
from stiffmap.machining.process.force import CuttingForce, cutting_force
from stiffmap.machining.process.identify.law import IdentifiedLaw, identify_process
from stiffmap.machining.process.load import load_process

__all__ = [
    "CuttingForce",
    "EndMill",
    "IdentifiedLaw",
    "Kienzle",
    "Process",
    "cutting_force",
    "identify_process",
    "load_process",
]

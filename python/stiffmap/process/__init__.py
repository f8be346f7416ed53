"""Processes: a tool, a law of its cutting force, speeds and a cut; forces from them, and laws from measured forces."""

from stiffmap.process.description import Cut, EndMill, Kienzle, Process, Tool, Trimming
from stiffmap.process.force import CuttingForce, cutting_force
from stiffmap.process.identify import IdentifiedLaw, identify_process
from stiffmap.process.load import load_process, process_names

__all__ = [
    "Cut",
    "CuttingForce",
    "EndMill",
    "IdentifiedLaw",
    "Kienzle",
    "Process",
    "Tool",
    "Trimming",
    "cutting_force",
    "identify_process",
    "load_process",
    "process_names",
]

"""Processes: a tool, a law of its cutting force, speeds and a cut; forces from them, and laws from measured forces."""

from stiffmap.machining.process.description import Cut, EndMill, Kienzle, Process, Tool, Trimming
from stiffmap.machining.process.force import CuttingForce, cutting_force
from stiffmap.machining.process.identify import IdentifiedLaw, identify_process
from stiffmap.machining.process.load import load_process, process_names

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

"""Tensions of cable machines: structure matrices, distributions within limits, wrench-feasible boxes (docs/cables.md)."""

from stiffmap.workspace.cables.distribution import TensionDistribution, tension_distribution
from stiffmap.workspace.cables.feasible import WrenchFeasible, wrench_feasible
from stiffmap.workspace.cables.structure import structure_matrix

__all__ = [
    "TensionDistribution",
    "WrenchFeasible",
    "structure_matrix",
    "tension_distribution",
    "wrench_feasible",
]

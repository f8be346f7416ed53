"""Tensions of cable machines: structure matrices, distributions within limits, wrench-feasible boxes (docs/cables.md)."""

from stiffmap.workspace.cables.feasible import WrenchFeasible, wrench_feasible
from stiffmap.workspace.cables.structure import TensionDistribution, structure_matrix, tension_distribution

__all__ = [
    "TensionDistribution", "WrenchFeasible", "structure_matrix", "tension_distribution", "wrench_feasible",
]  # fmt: skip

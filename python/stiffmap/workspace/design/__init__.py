"""Multicriterion design: any numbers of a machine file, any measures (docs/design.md)."""

from stiffmap.workspace.design.problem import load_design
from stiffmap.workspace.design.search import ParetoSet, optimize

__all__ = ["ParetoSet", "load_design", "optimize"]

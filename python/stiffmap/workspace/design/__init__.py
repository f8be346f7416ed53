"""Multicriterion design: any numbers of a machine file, any measures (docs/design.md)."""

from stiffmap.workspace.design.problem import Design, load_design
from stiffmap.workspace.design.search import ParetoSet, optimize

__all__ = ["Design", "ParetoSet", "load_design", "optimize"]

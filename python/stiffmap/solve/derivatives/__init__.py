"""Derivatives of an equilibrium and its stiffness with respect to parameters, pose and load (docs/effects.md)."""

from stiffmap.solve.derivatives.differentiate import differentiate
from stiffmap.solve.derivatives.prepared import DISPLACEMENT, Prepared, Request, prepare, read_requests

__all__ = ["DISPLACEMENT", "Prepared", "Request", "differentiate", "prepare", "read_requests"]

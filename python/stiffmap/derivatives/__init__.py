"""Derivatives of an equilibrium and its stiffness with respect to parameters, pose and load (docs/effects.md)."""

from stiffmap.derivatives.differentiate import differentiate
from stiffmap.derivatives.prepared import Prepared, prepare
from stiffmap.derivatives.requests import EffectRequest, Request, Requests, read_requests

__all__ = [
    "EffectRequest",
    "Prepared",
    "Request",
    "Requests",
    "differentiate",
    "prepare",
    "read_requests",
]

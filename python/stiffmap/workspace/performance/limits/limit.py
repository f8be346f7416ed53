"""One bound of a workspace at poses."""

from __future__ import annotations

from dataclasses import dataclass

from stiffmap.common.broadcasting import Floats

UNLIMITED = 1e299


@dataclass(frozen=True, eq=False)
class Limit:
    """One bound ``value <= most`` at poses (n,), of a smooth array."""

    name: str
    value: Floats
    """(n,)"""
    most: float
    array: Floats
    """(n, a) the smooth array, in the unit of `value`: |change of value| <= |change of array|."""
    left: Floats
    """(n, a): a lower estimate of the value at a neighbour is left·(array there), the value being convex."""

"""Chatter: stability lobes of a cut on a machine, by zero order and by semi-discretization, and mode coupling."""

from stiffmap.chatter.floquet import floquet_multiplier
from stiffmap.chatter.lobes import stability_lobes
from stiffmap.chatter.workspace import vibration_map
from stiffmap.chatter.zero_order import limiting_depth

__all__ = ["floquet_multiplier", "limiting_depth", "stability_lobes", "vibration_map"]

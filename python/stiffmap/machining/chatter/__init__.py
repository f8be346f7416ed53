"""Chatter: stability lobes of a cut on a machine, by zero order and by semi-discretization, and mode coupling."""

from stiffmap.machining.chatter.cut import floquet_multiplier
from stiffmap.machining.chatter.lobes import stability_lobes
from stiffmap.machining.chatter.workspace import vibration_map
from stiffmap.machining.chatter.zero_order import limiting_depth

__all__ = ["floquet_multiplier", "limiting_depth", "stability_lobes", "vibration_map"]

"""Numbers of a machine and its instrument that may be off: their uncertainties, and how readings depend on them."""

from stiffmap.identification.numbers.certificate import Tolerances, certified
from stiffmap.identification.numbers.unknowns import GEOMETRY, GROUPS, Unknown, unknowns

__all__ = ["GEOMETRY", "GROUPS", "Tolerances", "Unknown", "certified", "unknowns"]

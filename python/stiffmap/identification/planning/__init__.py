"""Which rows to measure: designs that identify parameters, separate rivals, or make a map certain."""

from stiffmap.identification.planning.design import Design, follow, plan
from stiffmap.identification.planning.estimate import Estimate, estimate

__all__ = ["Design", "Estimate", "estimate", "follow", "plan"]

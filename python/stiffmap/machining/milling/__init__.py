"""The cut on a machine: the part as it will be, and what to change."""

from stiffmap.machining.milling.dataset import sizes, verdict
from stiffmap.machining.milling.job import Milled, mill, mill_job

__all__ = ["Milled", "mill", "mill_job", "sizes", "verdict"]

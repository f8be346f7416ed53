"""The cut on a machine: the part as it will be, and what to change."""

from stiffmap.machining.milling.job import Milled, mill, mill_job
from stiffmap.machining.milling.verdict import sizes, verdict

__all__ = ["Milled", "mill", "mill_job", "sizes", "verdict"]

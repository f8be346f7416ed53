"""Laws of the cutting force from measured forces."""

from stiffmap.machining.process.identify.fitting import identify_process
from stiffmap.machining.process.identify.law import IdentifiedLaw
from stiffmap.machining.process.identify.table import ForceTable, read_table

__all__ = ["ForceTable", "IdentifiedLaw", "identify_process", "read_table"]

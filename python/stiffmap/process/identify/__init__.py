"""Laws of the cutting force from measured forces."""

from stiffmap.process.identify.law import IdentifiedLaw, identify_process
from stiffmap.process.identify.table import ForceTable, read_table

__all__ = ["ForceTable", "IdentifiedLaw", "identify_process", "read_table"]

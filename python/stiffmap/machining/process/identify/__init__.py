"""Laws of the cutting force from measured forces."""

from stiffmap.machining.process.identify.fitting import identify_process
from stiffmap.machining.process.identify.law import IdentifiedLaw

__all__ = ["IdentifiedLaw", "identify_process"]

"""Laws of the cutting force from measured forces."""

from stiffmap.machining.process.identify.law import IdentifiedLaw, identify_process

__all__ = ["IdentifiedLaw", "identify_process"]

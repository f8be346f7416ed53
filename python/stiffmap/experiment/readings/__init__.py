"""What a row may read in addition to the six axes of a pose and joints: one kind, one file with a ``READING``."""

from stiffmap.experiment.readings.registry import kind_of, kinds, load_readings, register, unregister
from stiffmap.experiment.readings.types import ReadingKind, Seen

__all__ = ["ReadingKind", "Seen", "kind_of", "kinds", "load_readings", "register", "unregister"]

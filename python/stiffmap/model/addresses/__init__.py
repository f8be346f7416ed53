"""Every number of a machine by one address, ``full.name/field``: read, listed, set to a value, moved as built."""

from stiffmap.model.addresses.places import Listed, listed
from stiffmap.model.addresses.setting import known_values, moved, number, with_values

__all__ = ["Listed", "known_values", "listed", "moved", "number", "with_values"]

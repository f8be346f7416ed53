"""Errors that stiffmap raises for bad input: one clear sentence each, never repaired silently."""


class StiffmapError(ValueError):
    """A problem in what the user gave, told in one line."""

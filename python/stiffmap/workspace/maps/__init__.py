"""Labelled results over a workspace: error maps, polar diagrams, force sweeps (xarray, SI)."""

from stiffmap.common.public import attached

__getattr__, __dir__, __all__ = attached(__name__, __file__)

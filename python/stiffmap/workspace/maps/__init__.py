"""Labelled results over a workspace: error maps, polar diagrams, force sweeps (xarray, SI)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

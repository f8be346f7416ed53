"""Labelled results over a workspace: error maps, polar diagrams, force sweeps (xarray, SI)."""

from stiffmap.maps.grid_map import error_map
from stiffmap.maps.polar_diagram import polar
from stiffmap.maps.ranking import uncertainty_ranking
from stiffmap.maps.sweep_line import sweep

__all__ = ["error_map", "polar", "sweep", "uncertainty_ranking"]

"""Labelled results over a workspace: error maps, polar diagrams, force sweeps (xarray, SI)."""

from stiffmap.maps.estimate import MapEstimate, map_estimate
from stiffmap.maps.grid_map import error_map
from stiffmap.maps.polar_diagram import polar
from stiffmap.maps.ranking import uncertainty_ranking
from stiffmap.maps.statistics import map_statistics
from stiffmap.maps.sweep_line import sweep
from stiffmap.maps.sweep_of_numbers import design_sweep

__all__ = [
    "MapEstimate",
    "design_sweep",
    "error_map",
    "map_estimate",
    "map_statistics",
    "polar",
    "sweep",
    "uncertainty_ranking",
]

"""Labelled results over a workspace: error maps, polar diagrams, force sweeps (xarray, SI)."""

from stiffmap.workspace.maps.extremes import polar
from stiffmap.workspace.maps.grid_map import error_map, map_estimate
from stiffmap.workspace.maps.statistics import map_statistics
from stiffmap.workspace.maps.sweep_line import sweep
from stiffmap.workspace.maps.sweep_of_numbers import design_sweep
from stiffmap.workspace.maps.uncertainty import uncertainty_ranking

__all__ = [
    "design_sweep", "error_map", "map_estimate", "map_statistics", "polar", "sweep", "uncertainty_ranking",
]  # fmt: skip

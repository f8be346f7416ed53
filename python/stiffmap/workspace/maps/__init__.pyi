from .extremes import polar as polar
from .grid_map import error_map as error_map, map_estimate as map_estimate
from .statistics import map_statistics as map_statistics
from .sweep_line import sweep as sweep
from .sweep_of_numbers import design_sweep as design_sweep
from .uncertainty import uncertainty_ranking as uncertainty_ranking

from .error_maps import map_figure as map_figure
from .forces import (
    ellipse_figure as ellipse_figure,
    polar_figure as polar_figure,
    stress_figure as stress_figure,
    sweep_figure as sweep_figure,
)
from .loaded import loaded_figure as loaded_figure, machine_figure as machine_figure
from .paths import mode_figure as mode_figure, path_figure as path_figure
from .style import save as save

"""Pictures for papers and screens: functions that return a matplotlib Figure, and `save`.

Lengths in mm, angles in deg; colours that a colour-blind reader can distinguish; failed poses hatched,
never shown as a value. No display is needed.
"""

from stiffmap.common.arguments import checked
from stiffmap.ui.plot.error_maps import map_figure
from stiffmap.ui.plot.forces import ellipse_figure, polar_figure, stress_figure, sweep_figure
from stiffmap.ui.plot.loaded import loaded_figure, machine_figure
from stiffmap.ui.plot.paths import mode_figure, path_figure
from stiffmap.ui.plot.style import save

__all__ = ["ellipse_figure", "loaded_figure", "machine_figure", "map_figure", "mode_figure", "path_figure",
           "polar_figure", "save", "stress_figure", "sweep_figure"]  # fmt: skip

for _name in __all__:
    globals()[_name] = checked(globals()[_name])

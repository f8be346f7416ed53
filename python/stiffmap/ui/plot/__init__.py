"""Pictures for papers and screens: functions that return a matplotlib Figure, and `save`.

Lengths in mm, angles in deg; colours that a colour-blind reader can distinguish; failed poses hatched,
never shown as a value. No display is needed.
"""

from stiffmap.common.public import attached

__getattr__, __dir__, __all__ = attached(__name__, __file__, check=True)

"""Everything that a person sees or types: commands, plots, reports, the live view, the paper's statements."""

from stiffmap.common.public import attached

__getattr__, __dir__, __all__ = attached(__name__, __file__)

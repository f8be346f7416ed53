"""Everything that a person sees or types: commands, plots, reports, the live view, the paper's statements."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

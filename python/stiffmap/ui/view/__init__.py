"""A machine and its map, live in a browser (``stiffmap view``, `Machine.view`); needs the extra ``[view]``."""

from stiffmap.ui.view.open import View, model_of, open_view
from stiffmap.ui.view.state import ViewState

__all__ = ["View", "ViewState", "model_of", "open_view"]

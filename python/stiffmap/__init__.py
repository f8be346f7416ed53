"""Stiffness of robots and parallel machines under load."""

from stiffmap.common.from_above import PLACES
from stiffmap.common.public import attached

PLACES |= {
    "Machine.view": ("stiffmap.ui.view", "open_view"),
    "Diagnosis.report": ("stiffmap.ui.report.diagnosis.page", "write_report"),
}
__getattr__, __dir__, __all__ = attached(__name__, __file__, check=True)

"""Commands and geometry for a controller, from a machine whose deviations are known."""

from stiffmap.compensation.commands import Commands, compensate
from stiffmap.compensation.geometry import DhRow, corrected_geometry, dh_list
from stiffmap.compensation.urdf import urdf_text

__all__ = ["Commands", "DhRow", "compensate", "corrected_geometry", "dh_list", "urdf_text"]

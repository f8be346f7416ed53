"""Commands and geometry for a controller, from a machine whose deviations are known."""

from stiffmap.compensation.axis_errors import AxisErrors, axis_errors, axis_errors_of_map
from stiffmap.compensation.commands import Commands, compensate
from stiffmap.compensation.geometry import DhRow, corrected_geometry, dh_list
from stiffmap.compensation.tables import FORMATS, compensation_table, read_table, write_table
from stiffmap.compensation.urdf import urdf_text

__all__ = [
    "FORMATS",
    "AxisErrors",
    "Commands",
    "DhRow",
    "axis_errors",
    "axis_errors_of_map",
    "compensate",
    "compensation_table",
    "corrected_geometry",
    "dh_list",
    "read_table",
    "urdf_text",
    "write_table",
]

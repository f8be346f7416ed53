"""Commands and geometry for a controller, from a machine whose deviations are known."""

from stiffmap.machining.compensation.axis_errors import AxisErrors, axis_errors, axis_errors_of_map
from stiffmap.machining.compensation.check import CompensationCheck, check_compensation
from stiffmap.machining.compensation.commands import Commands, compensate
from stiffmap.machining.compensation.geometry import write_dh, write_urdf
from stiffmap.machining.compensation.tables import compensation_table, read_table, write_table

__all__ = [
    "AxisErrors",
    "Commands",
    "CompensationCheck",
    "axis_errors",
    "axis_errors_of_map",
    "check_compensation",
    "compensate",
    "compensation_table",
    "read_table",
    "write_dh",
    "write_table",
    "write_urdf",
]

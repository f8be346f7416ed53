"""Calibration: every uncertain number of a machine from readings, at once; effects come on top of it."""

from stiffmap.calibration.calibrate import calibrate
from stiffmap.calibration.calibrator import Calibrator
from stiffmap.calibration.certificate import certified
from stiffmap.calibration.defaults import Tolerances
from stiffmap.calibration.result import Calibration
from stiffmap.calibration.unknowns import GEOMETRY, GROUPS, Unknown, unknowns

__all__ = [
    "GEOMETRY",
    "GROUPS",
    "Calibration",
    "Calibrator",
    "Tolerances",
    "Unknown",
    "calibrate",
    "certified",
    "unknowns",
]

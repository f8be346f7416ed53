"""Calibration: every uncertain number of a machine from readings, at once; effects come on top of it."""

from stiffmap.identification.calibration.calibrate import calibrate
from stiffmap.identification.calibration.calibrator import Calibrator
from stiffmap.identification.calibration.certificate import certified
from stiffmap.identification.calibration.defaults import Tolerances
from stiffmap.identification.calibration.result import Calibration
from stiffmap.identification.calibration.unknowns import GEOMETRY, GROUPS, Unknown, unknowns

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

"""Calibration: every uncertain number of a machine from readings, at once; the same inference as a diagnosis, without effects."""

from stiffmap.identification.calibration.calibrate import calibrate
from stiffmap.identification.calibration.result import Calibration

__all__ = ["Calibration", "calibrate"]

"""Vibration: damping, modes at the tool, frequency responses, tools coupled by receptance, files of measured responses."""

from stiffmap.vibration.modes import TipModes, tip_modes
from stiffmap.vibration.response import frequency_response

__all__ = ["TipModes", "frequency_response", "tip_modes"]

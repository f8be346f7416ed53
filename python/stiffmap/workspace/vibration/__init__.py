"""Vibration: damping, modes at the tool, frequency responses, files of measured responses and their modes."""

from stiffmap.workspace.vibration.modes import tip_modes
from stiffmap.workspace.vibration.response import frequency_response

__all__ = ["frequency_response", "tip_modes"]

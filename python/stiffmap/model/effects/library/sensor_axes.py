"""A displacement sensor whose axes are turned."""

from __future__ import annotations

from stiffmap.model.effects.library.geometry import rotation_of
from stiffmap.model.effects.library.measurement import ANGLES, measured, of_coordinates, turned
from stiffmap.model.effects.types import EffectType

EFFECT = EffectType(
    **measured("sensor_axes", "sensor", ANGLES),
    precedence=350,
    title="orientation of the displacement sensor",
    doc="The sensor's axes are turned against the declared ones: reading = (Rx·Ry·Rz)^T displacement.",
    frame="declared axes of the reading; about x, then the turned y, then the twice turned z",
    reading=of_coordinates(lambda values, parameters: turned(values, rotation_of(parameters).T)),
    hidden=lambda plan: plan.frame == "unknown",
)

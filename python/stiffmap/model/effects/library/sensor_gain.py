"""A displacement sensor that shows too much or too little."""

from __future__ import annotations

from stiffmap.model.effects.library.measurement import gains, measured, of_coordinates, scaled
from stiffmap.model.effects.types import EffectType

EFFECT = EffectType(
    **measured("sensor_gain", "sensor", gains("reading over displacement")),
    precedence=340,
    title="gain of the displacement sensor",
    doc="The reading is the displacement times gain, per axis times gain·gain_axis.",
    frame="axes of the reading",
    reading=of_coordinates(scaled),
    instrument_scale="gain",
)

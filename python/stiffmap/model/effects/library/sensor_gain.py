"""A displacement sensor that shows too much or too little."""

from __future__ import annotations

from stiffmap.model.effects.library.measurement import gains, measured, of_coordinates, scaled

EFFECT = measured(
    "sensor_gain",
    "gain of the displacement sensor",
    "The reading is the displacement times gain, per axis times gain·gain_axis.",
    "sensor",
    gains("reading over displacement"),
    340,
    frame="axes of the reading",
    reading=of_coordinates(scaled),
    instrument_scale="gain",
)

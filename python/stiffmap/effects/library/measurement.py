"""What the measurement adds to the machine: definitions only. The diagnosis applies them to readings."""

from __future__ import annotations

import math

from stiffmap.effects.library.geometry import AXES, names_of, rotations
from stiffmap.effects.sites import at, at_sites, elastic_drives
from stiffmap.effects.types import EffectType, Option, Parameter

ANGLES: tuple[Parameter, ...] = rotations("rotation")


def gains(doc: str) -> tuple[Parameter, ...]:
    """``gain`` of all axes and ``gain_x`` … of single ones (they multiply)."""
    each = tuple(Parameter(f"gain_{a}", "1", 0.1, 10.0, 1.0, 0.01, f"{doc}, {a} axis alone") for a in AXES)
    return (Parameter("gain", "1", 0.1, 10.0, 1.0, 0.01, f"{doc}, all axes"), *each)


def positions(doc: str, size: float) -> tuple[Parameter, ...]:
    """``x``, ``y``, ``z`` (m)."""
    return tuple(Parameter(a, "m", -1.0, 1.0, 0.0, size, f"{doc} along {a}") for a in AXES)


def measured(
    kind: str,
    title: str,
    doc: str,
    element: str,
    parameters: tuple[Parameter, ...],
    frame: str = "base axes",
    pivot: str = "none",
    options: tuple[Option, ...] = (),
    needs: tuple[str, ...] = (),
) -> EffectType:
    """A kind that lives in the measurement."""
    return EffectType(
        kind=kind,
        title=title,
        doc=doc,
        parameters=parameters,
        places=at(element),
        apply=None,
        pivot=pivot,
        frame=frame,
        moves="nothing of the machine",
        options=options,
        vector=names_of(parameters),
        excludes=(kind,),
        needs=needs,
        measurement=True,
    )


LOAD_DIRECTION = measured(
    "load_direction",
    "direction of the applied force",
    "The force that acts is the declared one turned: f = Rx·Ry·Rz f_declared.",
    "load",
    ANGLES,
    frame="base axes; about x, then the turned y, then the twice turned z",
    pivot="the point where the force acts",
)
LOAD_GAIN = measured(
    "load_gain",
    "gain of the force measurement",
    "The force that acts is the declared one times gain, per axis times gain·gain_axis.",
    "load",
    gains("acting force over declared force"),
)
SENSOR_GAIN = measured(
    "sensor_gain",
    "gain of the displacement sensor",
    "The reading is the displacement times gain, per axis times gain·gain_axis.",
    "sensor",
    gains("reading over displacement"),
    frame="axes of the reading",
)
SENSOR_AXES = measured(
    "sensor_axes",
    "orientation of the displacement sensor",
    "The sensor's axes are turned against the declared ones: reading = (Rx·Ry·Rz)^T displacement.",
    "sensor",
    ANGLES,
    frame="declared axes of the reading; about x, then the turned y, then the twice turned z",
)
_SHIFTS = (
    *positions("shift of every reading", 1e-4),
    *(
        Parameter(
            f"angle_{a}", "rad", -math.pi, math.pi, 0.0, 1e-4, f"turn of the instrument's frame about {a}"
        )
        for a in AXES
    ),
)
FRAME_OFFSET = measured(
    "frame_offset",
    "position and orientation of the instrument's frame",
    (
        "The instrument's frame is not where it is believed: a measured position p reads as shift + "
        "Rx·Ry·Rz p, so that an error of position gains shift + (Rx·Ry·Rz - 1) p."
    ),
    "sensor",
    _SHIFTS,
    pivot="origin of the base",
)
DRIFT = measured(
    "drift",
    "drift of the instrument",
    "The reading gains the drift times (order - first order), or times the hours since the first reading.",
    "sensor",
    tuple(Parameter(a, "m", -1e-3, 1e-3, 0.0, 1e-8, f"per reading or per hour, {a}") for a in AXES),
    frame="axes of the reading",
    options=(Option("per", ("order", "hour"), "what the drift goes with"),),
    needs=("order",),
)
SERVO_SHARE = EffectType(
    kind="servo_share",
    title="yield of a drive before its motor's encoder",
    doc=(
        "The motor side of a drive reads `share` of the drive's deflection: what its position control "
        "yields. At 0 the motor stands and all yields behind it, at 1 behind the encoder nothing does. The "
        "machine at the tool is the same."
    ),
    parameters=(Parameter("share", "1", 0.0, 1.0, 0.0, 0.1, "share of the drive's deflection"),),
    places=at_sites(elastic_drives),
    apply=None,
    frame="the drive's coordinate",
    moves="nothing of the machine",
    excludes=("servo_share",),
    needs=("motor",),
    measurement=True,
)
EFFECTS = (LOAD_DIRECTION, LOAD_GAIN, SENSOR_GAIN, SENSOR_AXES, FRAME_OFFSET, DRIFT, SERVO_SHARE)

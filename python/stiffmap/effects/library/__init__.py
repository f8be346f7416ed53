"""One file per kind of effect, and the list of all of them.

To add one: write a file here with an ``EFFECT``, and name it in this list.
"""

from stiffmap.effects.library import (
    axis_tilt,
    base_compliance,
    bilinear,
    compliance,
    dead_zone,
    external_spring,
    friction,
    gravity,
    hardening,
    joint_clearance,
    joint_compliance,
    lead_error,
    leg_tilt,
    length,
    length_difference,
    measurement,
    parallelogram_parallelism,
    parallelogram_width,
    payload,
    periodic_error,
    position_dependent_compliance,
    position_offset,
    preload,
    tcp_offset,
    thermal_growth,
    tilt,
    tool_compliance,
    zero_offset,
)
from stiffmap.effects.types import EffectType

MACHINE = (
    compliance,
    dead_zone,
    hardening,
    bilinear,
    friction,
    position_dependent_compliance,
    zero_offset,
    lead_error,
    periodic_error,
    length,
    length_difference,
    thermal_growth,
    position_offset,
    tilt,
    axis_tilt,
    leg_tilt,
    parallelogram_width,
    parallelogram_parallelism,
    tcp_offset,
    joint_compliance,
    joint_clearance,
    base_compliance,
    tool_compliance,
    preload,
    gravity,
    payload,
    external_spring,
)

EFFECTS: tuple[EffectType, ...] = (*(module.EFFECT for module in MACHINE), *measurement.EFFECTS)

"""One file per kind of effect, and the list of all of them.

To add one: write a file here with an ``EFFECT``, and name it in this list.
"""

from stiffmap.effects.kinds import (
    compliance,
    dead_zone,
    friction,
    gravity,
    hardening,
    joint_compliance,
    lead_error,
    length,
    periodic_error,
    position_dependent_compliance,
    position_offset,
    tilt,
    zero_offset,
)
from stiffmap.effects.types import EffectType

EFFECTS: tuple[EffectType, ...] = tuple(
    module.EFFECT
    for module in (
        compliance,
        dead_zone,
        hardening,
        friction,
        position_dependent_compliance,
        zero_offset,
        lead_error,
        periodic_error,
        length,
        position_offset,
        tilt,
        joint_compliance,
        gravity,
    )
)

"""Drive compliance that depends on the stroke."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Joint
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.sites import each, elastic_drives
from stiffmap.model.effects.types import EffectType, Parameter, Placed

SLOPE = Parameter(
    "slope", "1/m", -100.0, 100.0, 0.0, 0.1, "relative change of the compliance per travel", angular="1/rad"
)


def sloped(e: Joint, placed: Placed) -> Elements:
    """Adds to the slope of the drive's compliance."""
    slope = e.compliance_slope + placed.values["slope"]
    for end in (e.drive.range or ()) if e.drive else ():
        if 1.0 + slope * (end - e.home[0]) <= 0.0:
            raise StiffmapError(f"slope {slope:g}: no compliance is left at {end:g}")
    return (replace(e, compliance_slope=slope),)


EFFECT = EffectType(
    kind="position_dependent_compliance",
    precedence=80,
    title="drive compliance that depends on the stroke",
    doc=(
        "Drive compliance times 1 + slope·(u - u_home) at the commanded coordinate u (a screw that yields "
        "more the longer it is)."
    ),
    parameters=(SLOPE,),
    **each(elastic_drives, sloped),
    pivot="the drive's home coordinate",
    frame="the drive's coordinate",
    excludes=("hardening", "friction"),
)

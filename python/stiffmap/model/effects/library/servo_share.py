"""A drive that yields before its motor's encoder."""

from __future__ import annotations

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects.evidence import Plan
from stiffmap.model.effects.sites import at_sites, elastic_drives
from stiffmap.model.effects.types import EffectType, Parameter


def reading(read: Floats, motion: Floats, plan: Plan, term: AppliedEffect) -> Floats:
    """A motor shows the share of its drive's deflection that lies before it."""
    mine = {f"{leg}.{term.element}" for leg in term.legs}
    out = read.copy()
    for i, channel in enumerate(plan.extra, start=6):
        if channel.side == "motor" and channel.joint in mine:
            out[:, i] = motion[:, i] * dict(term.parameters)["share"]
    return out


EFFECT = EffectType(
    kind="servo_share",
    precedence=380,
    title="yield of a drive before its motor's encoder",
    doc=(
        "The motor side of a drive reads `share` of the drive's deflection: what its position control "
        "yields. At 0 the motor stands and all yields behind it, at 1 behind the encoder nothing does. The "
        "machine at the tool is the same."
    ),
    parameters=(Parameter("share", "1", 0.0, 1.0, 0.0, 0.1, "share of the drive's deflection"),),
    places=at_sites(elastic_drives),
    apply=None,
    reading=reading,
    frame="the drive's coordinate",
    moves="nothing of the machine",
    excludes=("servo_share",),
    needs=("motor",),
)

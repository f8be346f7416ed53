"""What a cable is like otherwise than declared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.model.description import Body, Cable, MachineDescription
from stiffmap.model.description.tree import Elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.library.geometry import components
from stiffmap.model.effects.sites import at_sites, cables, each, led_cables
from stiffmap.model.effects.types import EffectType, Parameter, Placed


def stretched(e: Cable, placed: Placed) -> Elements:
    """The real cable yields that many times as much as the one that lengths are commanded for."""
    return (replace(e, stretch=e.stretch * placed.values["scale"]),)


CABLE_STRETCH = EffectType(
    kind="cable_stretch",
    title="elasticity of a cable",
    doc=(
        "The cable (with its lead and the stiffness in series) is `scale` times as compliant as declared; lengths are "
        "still commanded for the declared one, so that its pretension changes as well."
    ),
    parameters=(Parameter("scale", "1", 0.05, 50.0, 1.0, 0.1, "of the compliance", plausible=(0.3, 5.0)),),
    **each(cables, stretched),
    compared=("soft", "stiff"),
)


def rubbing(e: Cable, placed: Placed) -> Elements:
    """The lead between winch and guide has another tension than the free length, and stretches as it asks."""
    return (replace(e, lead_tension=e.lead_tension * (1.0 - placed.values["share"])),)


GUIDE_FRICTION = EffectType(
    kind="guide_friction",
    title="friction of a cable's guide",
    doc=(
        "The guide takes `share` of the free length's tension while that grows: the lead between winch and guide "
        "carries, and stretches by, so much less. Negative: while it falls. e^(mu angle) of a rope over a drum that "
        "stands still is a share of 1 - e^(-mu angle)."
    ),
    parameters=(Parameter("share", "1", -1.0, 1.0, 0.0, 0.05, "of the tension", plausible=(-0.3, 0.3)),),
    **each(led_cables, rubbing),
)


OFF = tuple(
    Parameter(n, "m", -1.0, 1.0, 0.0, 1e-3, f"real minus declared anchor, {n[1]}", default=0.0)
    for n in ("dx", "dy", "dz")
)


def displaced(e: Cable, placed: Placed) -> Elements:
    """The controller computes its lengths with the declared anchor."""
    x, y, z = e.anchor_error
    dx, dy, dz = (placed.values[p.name] for p in OFF)
    return (replace(e, anchor_error=(x + dx, y + dy, z + dz)),)


CABLE_ANCHOR = EffectType(
    kind="cable_anchor",
    title="anchor of a cable",
    doc="The cable enters its guide (dx, dy, dz) away from where its controller believes.",
    **components(OFF),
    **each(cables, displaced),
    frame="base axes",
)


def with_weight(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Half of the length at home hangs at the fixing point."""
    home = description.home

    def hung(e: Cable) -> Elements:
        length = float(np.linalg.norm(home.p + home.r @ np.array(e.at) - np.array(e.anchor)))
        return (e, Body(f"{e.name}_weight", 0.5 * placed.values["density"] * length, e.at))

    return change_sites(description, placed.legs, placed.element, cables, hung)


CABLE_MASS = EffectType(
    kind="cable_mass",
    title="mass of a cable",
    doc=(
        "The cable weighs `density` per length: half of its length at home hangs at its fixing point, the other half "
        "at its anchor. It stays straight (its sag is left out), and weighs where the machine has gravity."
    ),
    parameters=(Parameter("density", "kg/m", 0.0, 1e3, 0.0, 0.05, "mass per length"),),
    places=at_sites(cables),
    apply=with_weight,
    moves="with the platform",
    stage=70,
)

"""A workpiece or tool that the declaration leaves out."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Body, ExternalSpring, MachineDescription, Point
from stiffmap.model.description.pose import vector
from stiffmap.model.effects.edit import fresh
from stiffmap.model.effects.library.geometry import point, translation_of
from stiffmap.model.effects.library.gravity import STANDARD
from stiffmap.model.effects.sites import at
from stiffmap.model.effects.types import EffectType, Parameter, Placed

COM = point("com", "its centre from the TCP", reach=10.0)
FAR = 1e9


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A body where the machine has gravity, else a weight alone: the machine's own stays left out."""
    centre = vector(translation_of(placed.values, "com_"))
    name = fresh("payload", description.platform)
    if description.gravity is not None:
        body = Body(name, placed.values["mass"], centre)
        return replace(description, platform=(*description.platform, body))
    platform = (*description.platform, Point(name, centre))
    weight = _weight(name, placed.values["mass"])
    return replace(description, platform=platform, external_springs=(*description.external_springs, weight))


def _weight(name: str, mass: float) -> ExternalSpring:
    """A dead force: a spring of no length to an anchor so far that neither size nor direction change
    (by 1e-9 per metre of motion)."""
    return ExternalSpring(f"weight_{name}", f"platform.{name}", (0.0, 0.0, -FAR), mass * STANDARD / FAR, 0.0)


EFFECT = EffectType(
    kind="payload",
    precedence=300,
    title="load carried on the platform",
    doc=(
        "A mass on the platform that the declaration leaves out; it weighs along the machine's gravity. In a "
        "machine without gravity it alone weighs, 9.81 m/s² along base -z."
    ),
    parameters=(Parameter("mass", "kg", 0.0, 1e5, 0.0, 1.0, "of the load"), *COM),
    places=at("platform"),
    apply=apply,
    frame="platform axes (centre), base axes (weight)",
    moves="with the platform",
    stage=70,
)

"""Weight of the machine's bodies."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Body, MachineDescription
from stiffmap.model.description.tree import all_elements
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.sites import at_sites, bodies
from stiffmap.model.effects.types import EffectType, Parameter, Place, Placed

STANDARD = 9.81
DOWN = (0.0, 0.0, -STANDARD)
SCALE = Parameter("scale", "1", -10.0, 10.0, 0.0, 1.0, "factor on the declared masses; 1 = as declared")
MASS = Parameter("mass", "kg", 0.0, 1e5, 0.0, 1.0, "mass of each body of that name", fitted=False)


def find(description: MachineDescription) -> list[Place]:
    """The whole machine where it declares masses and no gravity; else each body."""
    heavy = any(isinstance(e, Body) and e.mass for _, e in all_elements(description))
    if heavy and description.gravity is None:
        return [("machine", ())]
    return at_sites(bodies)(description)


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Gravity on with the declared masses, or with the mass of one body."""
    if placed.element == "machine":
        if "scale" not in placed.values:
            raise StiffmapError("give scale for the machine; mass is for a single body")
        return replace(description, gravity=(0.0, 0.0, -STANDARD * placed.values["scale"]))
    if "mass" not in placed.values:
        raise StiffmapError("give mass (kg) for a body; scale is for the machine")
    place, mass = (placed.legs, placed.element, bodies), placed.values["mass"]
    changed = change_sites(description, *place, lambda e: (replace(e, mass=mass),))
    return replace(changed, gravity=description.gravity or DOWN)


def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
    """Scale for the machine, mass for a body."""
    whole = element == "machine"
    return (replace(SCALE, fitted=whole), replace(MASS, fitted=not whole))


EFFECT = EffectType(
    kind="gravity",
    precedence=290,
    title="weight of the machine's bodies",
    doc=(
        "The bodies weigh: 9.81 m/s² along base -z. On `machine` all declared masses times `scale`; on a "
        "body of a machine that declares no masses, or that has gravity already, `mass` is the mass of each "
        "such body."
    ),
    parameters=(SCALE, MASS),
    places=find,
    apply=apply,
    frame="base axes",
    moves="nothing; each weight acts where the machine file puts the body's centre of mass",
    one_of=("scale", "mass"),
    excludes=("gravity",),
    at=at,
)

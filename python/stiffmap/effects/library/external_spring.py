"""A cable, hose or counterbalance."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.description import ExternalSpring, MachineDescription
from stiffmap.description.tree import point_names
from stiffmap.effects.types import EffectType, Option, Parameter, Place, Placed

ANCHOR = tuple(
    Parameter(f"anchor_{a}", "m", -100.0, 100.0, None, 0.1, f"fixed end, {a}", fitted=False) for a in "xyz"
)


def points(description: MachineDescription) -> list[Place]:
    """The TCP and the named points, by their full names."""
    return [(name, ()) for name in ("tcp", *point_names(description))]


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """One more external spring, from the point to the anchor."""
    v = placed.values
    spring = ExternalSpring(
        f"effect_{len(description.external_springs) + 1}",
        placed.element,
        (v["anchor_x"], v["anchor_y"], v["anchor_z"]),
        v["stiffness"],
        v["length"],
        placed.options["tension_only"] == "yes",
    )
    return replace(description, external_springs=(*description.external_springs, spring))


EFFECT = EffectType(
    kind="external_spring",
    title="cable, hose or counterbalance",
    doc=(
        "A straight spring pulls the point towards an anchor fixed in the base: force stiffness·(distance - "
        "length) along the line; with `tension_only` none when slack."
    ),
    parameters=(
        Parameter("stiffness", "N/m", 0.0, 1e9, 0.0, 100.0, "of the spring"),
        Parameter("length", "m", 0.0, 100.0, None, 0.1, "free length", default=0.0),
        *ANCHOR,
    ),
    places=points,
    apply=apply,
    pivot="the anchor",
    frame="base axes",
    moves="nothing",
    options=(Option("tension_only", ("no", "yes"), "whether it can push"),),
)

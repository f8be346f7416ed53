"""Where a cable enters its guide."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.model.description import Cable, MachineDescription
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.sites import at_sites, cables
from stiffmap.model.effects.types import EffectType, Parameter, Placed

OFF = tuple(
    Parameter(n, "m", -1.0, 1.0, 0.0, 1e-3, f"real minus declared anchor, {n[1]}", default=0.0)
    for n in ("dx", "dy", "dz")
)


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """The controller computes its lengths with the declared anchor."""
    v = placed.values

    def change(e: Cable) -> Cable:
        x, y, z = e.anchor_error
        return replace(e, anchor_error=(x + v["dx"], y + v["dy"], z + v["dz"]))

    return change_sites(description, placed.legs, placed.element, cables, lambda e: (change(e),))  # type: ignore[arg-type]  # sites of cables


EFFECT = EffectType(
    kind="cable_anchor",
    precedence=165,
    title="anchor of a cable",
    doc="The cable enters its guide (dx, dy, dz) away from where its controller believes.",
    parameters=OFF,
    places=at_sites(cables),
    apply=apply,
    frame="base axes",
    moves="nothing",
    vector=("dx", "dy", "dz"),
)

"""Dry friction of a drive or an elastic joint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Law, MachineDescription
from stiffmap.model.effects.library.drive_law import change_law, linear
from stiffmap.model.effects.sites import at_sites, elastic_directions, elastic_drives
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed, is_revolute

BRANCHES = ("loading", "unloading", "loading_stuck")


def apply(description: MachineDescription, placed: Placed) -> MachineDescription:
    """One branch of the friction loop as a monotone polyline, a dead zone in series included."""
    level, branch = level_of(description, placed), placed.options["branch"]
    return change_law(description, placed, lambda old: _law(old, level, branch))


def level_of(description: MachineDescription, placed: Placed) -> float:
    """Coulomb level (N, N·m) at the place; StiffmapError where it is given in the other unit."""
    turns = is_revolute(description, placed.element)
    if ("torque" in placed.values) != turns:
        raise StiffmapError("give torque (N·m) where it turns and force (N) where it slides")
    return placed.values["torque" if turns else "force"]


def _law(old: Law, level: float, branch: str) -> Law:
    half = _gap(old)
    if level == 0.0:
        return old
    if branch == "loading":
        return replace(old, friction=level)
    if branch == "unloading":  # a = c (F + level sign F), as a dead zone
        reach = half + level / old.stiffness
        return Law(old.stiffness, knots=((-reach, 0.0), (reach, 0.0)))
    stuck = ((-half, -level), (-half, 0.0), (half, 0.0), (half, level))
    return Law(old.stiffness, knots=stuck if half > 0.0 else (stuck[0], stuck[3]))


def _gap(law: Law) -> float:
    """Half width of the dead zone that the law has, 0 for a linear one; StiffmapError for any other."""
    match law:
        case Law(cubic=0.0, knots=((_, 0.0), (half, 0.0))):
            return half
    linear(law)
    return 0.0


def dry(force: str, torque: str, *branches: str) -> dict[str, Any]:
    """What effects of dry friction share: a Coulomb level where it slides and one where it turns, of which the other is
    not to be fitted, and the branch on which the load was reached."""
    parameters = (
        Parameter("force", "N", 0.0, 1e5, 0.0, 10.0, force),
        Parameter("torque", "N·m", 0.0, 1e5, 0.0, 1.0, torque),
    )

    def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
        turns = is_revolute(description, element)
        return tuple(replace(p, fitted=turns == (p.name == "torque")) for p in parameters)

    return {
        "parameters": parameters,
        "reverses": True,
        "options": (Option("branch", branches, "how the load was reached", recorded=True),),
        "one_of": ("force", "torque"),
        "stage": 20,
        "better_with": ("branch",),
        "at": at,
    }


EFFECT = EffectType(
    kind="friction",
    precedence=60,
    title="dry friction of a drive, an elastic joint or a spring's direction",
    doc=(
        "Coulomb friction parallel to the spring of a drive, an elastic joint or an uncoupled direction of a link spring "
        "(element `foot.k22`; a bolted joint that slips), against the spring's motion from its unloaded state, "
        "with the deflection a and the force F, level L and compliance c: on "
        "the branch `loading` (from zero load) a = c·(F - L·sign F); on the branch `unloading` (from a "
        "larger load, friction fully reversed) a = c·(F + L·sign F). `loading` takes the full level also "
        "where |F| < L, with the sign that F has in linear statics without friction; a drive that really "
        "sticks there, a = 0, is `loading_stuck`. Both agree where |F| > L."
    ),
    **dry("Coulomb level where it slides", "Coulomb level where it turns", *BRANCHES),
    places=at_sites(elastic_directions),
    apply=apply,
    tried=at_sites(elastic_drives),
    frame="the coordinate",
    excludes=("friction", "hardening", "position_dependent_compliance", "tabulated"),
)

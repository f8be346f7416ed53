"""Dry friction of a drive or an elastic joint."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Law, MachineDescription
from stiffmap.model.effects.library.drive_law import change_law, linear
from stiffmap.model.effects.sites import at_sites, elastic_directions, elastic_drives
from stiffmap.model.effects.types import EffectType, Option, Parameter, ParametersAt, Placed, is_revolute

FORCE = Parameter("force", "N", 0.0, 1e5, 0.0, 10.0, "Coulomb level where it slides")
TORQUE = Parameter("torque", "N·m", 0.0, 1e5, 0.0, 1.0, "Coulomb level where it turns")


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


def force_or_torque(force: Parameter, torque: Parameter) -> ParametersAt:
    """Torque where it turns, force where it slides: the other is not to be fitted."""

    def at(description: MachineDescription, element: str, legs: tuple[str, ...]) -> tuple[Parameter, ...]:
        turns = is_revolute(description, element)
        return (replace(force, fitted=not turns), replace(torque, fitted=turns))

    return at


EFFECT = EffectType(
    kind="friction",
    precedence=60,
    reverses=True,
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
    parameters=(FORCE, TORQUE),
    places=at_sites(elastic_directions),
    apply=apply,
    tried=at_sites(elastic_drives),
    frame="the coordinate",
    options=(
        Option(
            "branch", ("loading", "unloading", "loading_stuck"), "how the load was reached", recorded=True
        ),
    ),
    one_of=("force", "torque"),
    excludes=("friction", "hardening", "position_dependent_compliance", "tabulated"),
    stage=20,
    better_with=("branch",),
    at=force_or_torque(FORCE, TORQUE),
)

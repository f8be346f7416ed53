"""Dry friction of drives and joints, and what a drive remembers: friction, play and stiffening along a sequence of loads.

Memory, theory L5: the spring's force s follows the drive's force F as a play operator does, |F - s| <= level; deflection is a
function of s. That is Coulomb friction parallel to a spring, exactly, for any monotone law; many elements with levels of their
own are a Prandtl-Ishlinskii model, which obeys Masing's rule.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import JointFriction, Law, MachineDescription
from stiffmap.model.effects.edit import change_sites
from stiffmap.model.effects.evidence import shares_of_load
from stiffmap.model.effects.library.laws import HALF_WIDTH, change_law, linear
from stiffmap.model.effects.sites import at_sites, elastic_directions, elastic_drives, free_joints
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed, is_revolute

BRANCHES = ("loading", "unloading", "loading_stuck")


def with_friction(description: MachineDescription, placed: Placed) -> MachineDescription:
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


FRICTION = EffectType(
    kind="friction",
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
    apply=with_friction,
    tried=at_sites(elastic_drives),
    frame="the coordinate",
    excludes=("friction", "hardening", "position_dependent_compliance", "tabulated"),
)


def with_joint_friction(description: MachineDescription, placed: Placed) -> MachineDescription:
    """Friction on each joint of the place; none at the level 0."""
    level = level_of(description, placed)
    new = JointFriction(level, placed.options["branch"]) if level > 0.0 else None
    place = (placed.legs, placed.element, free_joints)
    return change_sites(description, *place, lambda e: (replace(e, friction=new),))


JOINT_FRICTION = EffectType(
    kind="joint_friction",
    title="dry friction of a passive joint",
    doc=(
        "Coulomb friction about each axis of a free passive joint, level L, against its motion q from the commanded "
        "configuration: on the branch `loading` (from zero load) the joint resists with L against the motion that it "
        "makes without friction; on `unloading` (from a larger load, friction fully reversed) L acts with it; "
        "`loading_stuck` holds the joint at q = 0 until L is reached and resists with L beyond. Where a joint slips, "
        "`loading` and `loading_stuck` agree; where it would not, `loading` pushes it back too far."
    ),
    **dry(
        "Coulomb level of a sliding joint",
        "Coulomb level about each axis of a joint that turns",
        "loading_stuck",
        "loading",
        "unloading",
    ),
    places=at_sites(free_joints),
    apply=with_joint_friction,
    frame="the joint's axes",
    excludes=("joint_friction",),
)


PARAMETERS = (
    Parameter("level", "N", 0.0, 1e6, 0.0, 1.0, "Coulomb level", default=0.0, angular="N·m"),
    Parameter("spread", "1", 0.0, 1.0, 0.0, 0.1, "half width of the levels about it, relative", default=0.0),
    Parameter("breakaway", "1", 1.0, 10.0, 1.0, 0.1, "level at standstill over it", default=1.0),
    replace(HALF_WIDTH, doc="play to each side", default=0.0),
    Parameter(
        "seat", "N", 1e-6, 1e6, None, 1.0, "force over which the play is crossed", default=1e-3, angular="N·m"
    ),
    Parameter("ratio", "1", 1e-3, 1e3, 1.0, 0.1, "compliance at large loads over that at small ones", default=1.0),
    Parameter("knee", "N", 1e-6, 1e6, None, 100.0, "force where it changes", default=100.0, angular="N·m"),
)  # fmt: skip
ELEMENTS = 16
"""Elements that stand for a spread of levels."""
SEATS = (0.003, 0.03, 0.1)
"""Shares of the largest load within which play is crossed."""


def spring_force(force: Floats, level: ArrayLike, breakaway: float = 1.0) -> Floats:
    """(n, ...) force s that the spring feels while the drive's `force` (n,) runs, from rest at s = 0, with
    elements of these levels (...)."""
    levels = np.asarray(level, dtype=float)
    each = [_of_one(force.tolist(), float(v), breakaway) for v in levels.ravel()]
    return np.stack(each, axis=1).reshape(len(force), *levels.shape)


def _of_one(force: list[float], level: float, breakaway: float) -> list[float]:
    """`spring_force` of one element, on plain numbers."""
    s, sliding, out = 0.0, 0.0, []
    for f in force:
        gap = f - s
        ahead = sliding * gap
        if abs(gap) > (level if ahead > 0 else level * breakaway):
            sliding = 1.0 if gap > 0 else -1.0
            s = f - sliding * level
        elif ahead < level * (1 - 1e-12):
            sliding = 0.0
        out.append(s)
    return out


def deflection(force: Floats, compliance: float, values: Mapping[str, float]) -> Floats:
    """(n,) deflection of a drive while `force` (n,) runs, theory L5."""
    level, spread = values["level"], values["spread"]
    levels = level * (1 + spread * np.linspace(-1, 1, ELEMENTS)) if spread > 0 else np.array([level])
    ratio, knee = values["ratio"], values["knee"]
    s = spring_force(force, levels, values["breakaway"])
    bent = ratio * s + (1 - ratio) * knee * np.tanh(s / knee)
    return np.asarray((compliance * bent + values["half_width"] * np.tanh(s / values["seat"])).mean(axis=1))


HYSTERESIS = EffectType(
    kind="hysteresis",
    reverses=True,
    title="friction, play and stiffening of a drive along a sequence of loads",
    doc=(
        "Rows in order of time; a set-up starts afresh. The force s that the drive's spring feels follows the drive's "
        "force F within the friction: |F - s| is at most `level`, or `level` times `breakaway` while s stands still; "
        "with `spread` it is the mean of many such elements, levels evenly between (1 - spread) and (1 + spread) "
        "times `level`. The deflection is then the drive's own at s, its compliance c changed from c to ratio·c at the "
        "`knee`, plus play: c·(ratio·s + (1 - ratio)·knee·tanh(s/knee)) + half_width·tanh(s/seat)."
    ),
    parameters=PARAMETERS,
    places=at_sites(elastic_drives),
    apply=None,
    signature=partial(shares_of_load, name="seat", shares=SEATS),
    hidden=lambda plan: plan.load_direction is None,  # memory is nothing to see where loads jump
    tried=at_sites(elastic_drives),
    moved=("level", "half_width", "seat"),
    frame="the drive's coordinate",
    moves="what the drive moves",
    excludes=("hysteresis", "friction"),
    needs=("order",),
    drive=deflection,
)

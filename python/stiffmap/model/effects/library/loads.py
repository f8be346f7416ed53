"""Weights, springs between the machine and the ground, links mounted under tension."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Body, ExternalSpring, MachineDescription, Point, Spring
from stiffmap.model.description.pose import vector
from stiffmap.model.description.tree import Elements, all_elements, spring_points
from stiffmap.model.effects.edit import change_sites, fresh
from stiffmap.model.effects.evidence import Probe, Signature, Tried
from stiffmap.model.effects.library.geometry import point, translation_of, translations
from stiffmap.model.effects.sites import at, at_sites, bodies, each, springs
from stiffmap.model.effects.types import EffectType, Option, Parameter, Place, Placed

STANDARD = 9.81
DOWN = (0.0, 0.0, -STANDARD)
SCALE = Parameter("scale", "1", -10.0, 10.0, 0.0, 1.0, "factor on the declared masses; 1 = as declared")
MASS = Parameter("mass", "kg", 0.0, 1e5, 0.0, 1.0, "mass of each body of that name", fitted=False)


def heavy_places(description: MachineDescription) -> list[Place]:
    """The whole machine where it declares masses and no gravity; else each body."""
    heavy = any(isinstance(e, Body) and e.mass for _, e in all_elements(description))
    if heavy and description.gravity is None:
        return [("machine", ())]
    return at_sites(bodies)(description)


def with_gravity(description: MachineDescription, placed: Placed) -> MachineDescription:
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


def scale_or_mass(
    description: MachineDescription, element: str, legs: tuple[str, ...]
) -> tuple[Parameter, ...]:
    """Scale for the machine, mass for a body."""
    whole = element == "machine"
    return (replace(SCALE, fitted=whole), replace(MASS, fitted=not whole))


GRAVITY = EffectType(
    kind="gravity",
    title="weight of the machine's bodies",
    doc=(
        "The bodies weigh: 9.81 m/s² along base -z. On `machine` all declared masses times `scale`; on a "
        "body of a machine that declares no masses, or that has gravity already, `mass` is the mass of each "
        "such body."
    ),
    parameters=(SCALE, MASS),
    places=heavy_places,
    apply=with_gravity,
    frame="base axes",
    moves="nothing; each weight acts where the machine file puts the body's centre of mass",
    one_of=("scale", "mass"),
    excludes=("gravity",),
    at=scale_or_mass,
)


COM = point("com", "its centre from the TCP", reach=10.0)
FAR = 1e9


def with_payload(description: MachineDescription, placed: Placed) -> MachineDescription:
    """A body where the machine has gravity, else a weight alone: the machine's own stays left out."""
    centre = vector(translation_of(placed.values, "com_"))
    name = fresh("payload", description.platform)
    if description.gravity is not None:
        body = Body(name, placed.values["mass"], centre)
        return replace(description, platform=(*description.platform, body))
    platform = (*description.platform, Point(name, centre))
    # a dead force: to an anchor so far that neither size nor direction change (by 1e-9 per metre of motion)
    stiffness = placed.values["mass"] * STANDARD / FAR
    weight = ExternalSpring(f"weight_{name}", f"platform.{name}", (0.0, 0.0, -FAR), stiffness, 0.0)
    return replace(description, platform=platform, external_springs=(*description.external_springs, weight))


PAYLOAD = EffectType(
    kind="payload",
    title="load carried on the platform",
    doc=(
        "A mass on the platform that the declaration leaves out; it weighs along the machine's gravity. In a "
        "machine without gravity it alone weighs, 9.81 m/s² along base -z."
    ),
    parameters=(Parameter("mass", "kg", 0.0, 1e5, 0.0, 1.0, "of the load"), *COM),
    places=at("platform"),
    apply=with_payload,
    frame="platform axes (centre), base axes (weight)",
    moves="with the platform",
    stage=70,
)


SLACK = (0.0, 0.7)
"""Free length as a share of the distance to the middle of the plan."""
HARDEST = 1e4
"""N: no tool is pulled harder, whatever is read; a spring that shows by its stiffness alone would pull with meganewtons."""
NEAR = (-10.0, 10.0)
"""m: a spring from further away is a constant force, which a load or its direction is as well."""
ANCHOR = tuple(
    Parameter(f"anchor_{a}", "m", -100.0, 100.0, None, 0.1, f"fixed end, {a}", fitted=False, plausible=NEAR)
    for a in "xyz"
)


def with_spring(description: MachineDescription, placed: Placed) -> MachineDescription:
    """One more external spring, from the point to the anchor."""
    v = placed.values
    name, pulls_only = (
        f"effect_{len(description.external_springs) + 1}",
        placed.options["tension_only"] == "yes",
    )
    anchor = (v["anchor_x"], v["anchor_y"], v["anchor_z"])
    spring = ExternalSpring(name, placed.element, anchor, v["stiffness"], v["length"], pulls_only)
    return replace(description, external_springs=(*description.external_springs, spring))


def signature(probe: Probe, tried: Tried) -> Iterator[Signature]:
    """To first order a force at the point, whatever the anchor: the readings' compliance there gives the change for
    every anchor and free length."""
    plan = probe.plan
    if tried.element != plan.load_point:
        raise StiffmapError(f"a spring is tried where forces act only ({plan.load_point})")
    scale, yields = tried.parameters[0].scale, probe.compliance()
    for anchor, length in anchors(plan.position):
        pull = _force(plan.position + probe.base[:, :3], anchor, length)
        most = HARDEST / (scale * float(np.nanmax(np.linalg.norm(pull, axis=1))))
        if plan.quantity == "deflection":
            pull = pull - _force(plan.position, anchor, length)
        column = np.einsum("nij,nj->ni", yields, pull) * scale
        named = zip(("anchor_x", "anchor_y", "anchor_z"), anchor.tolist(), strict=True)
        yield Signature({"length": length, **dict(named)}, column[..., None], grows=True, most=most)


def anchors(position: Floats) -> Iterator[tuple[Floats, float]]:
    """Faces and corners of a cube of twice the plan's extent, each with the free lengths."""
    low, high = position.min(axis=0), position.max(axis=0)
    reach = max(float((high - low).max()), 0.1)
    for way in product((-1.0, 0.0, 1.0), repeat=3):
        if sum(map(abs, way)) in (1.0, 3.0):
            away = np.array(way) * reach
            for share in SLACK:
                yield (low + high) / 2 + away, share * float(np.linalg.norm(away))


def _force(at: Floats, anchor: Floats, length: float) -> Floats:
    line = anchor - at
    distance = np.linalg.norm(line, axis=1, keepdims=True)
    return np.asarray((distance - length) * line / distance)


EXTERNAL_SPRING = EffectType(
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
    places=lambda description: [(name, ()) for name in spring_points(description)],
    apply=with_spring,
    signature=signature,
    pivot="the anchor",
    frame="base axes",
    options=(Option("tension_only", ("no", "yes"), "whether it can push"),),
)


def pulled(e: Spring, placed: Placed) -> Elements:
    """Moves the deflection at which the spring is free of force."""
    x, y, z = translation_of(placed.values, "rest_")
    a, b, c, *rotations = e.rest
    return (replace(e, rest=(a + x, b + y, c + z, *rotations)),)


PRELOAD = EffectType(
    kind="preload",
    title="link mounted under tension",
    doc=(
        "The link is free of force not at zero deflection but at `rest`: mounted, it pulls the machine. In a "
        "parallelogram both bars alike."
    ),
    **translations("force-free deflection", "rest_"),
    **each(springs, pulled),
    frame="local axes of the spring",
    moves="all behind the link",
)

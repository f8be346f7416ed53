"""A cable, hose or counterbalance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import ExternalSpring, MachineDescription
from stiffmap.model.description.tree import point_names
from stiffmap.model.effects.evidence import Probe, Signature, Tried
from stiffmap.model.effects.types import EffectType, Option, Parameter, Place, Placed

SLACK = (0.0, 0.7)
"""Free length as a share of the distance to the middle of the plan."""
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


def signature(probe: Probe, tried: Tried) -> Iterator[Signature]:
    """To first order a force at the point, whatever the anchor: the readings' compliance there gives the change for
    every anchor and free length."""
    plan = probe.plan
    if tried.element != plan.load_point:
        raise StiffmapError(f"a spring is tried where forces act only ({plan.load_point})")
    scale, yields = tried.parameters[0].scale, probe.compliance()
    for anchor, length in anchors(plan.position):
        pull = _force(plan.position + probe.base[:, :3], anchor, length)
        if plan.quantity == "deflection":
            pull = pull - _force(plan.position, anchor, length)
        column = np.einsum("nij,nj->ni", yields, pull) * scale
        named = zip(("anchor_x", "anchor_y", "anchor_z"), anchor.tolist(), strict=True)
        yield Signature({"length": length, **dict(named)}, column[..., None], grows=True)


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


EFFECT = EffectType(
    kind="external_spring",
    precedence=310,
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
    signature=signature,
    pivot="the anchor",
    frame="base axes",
    moves="nothing",
    options=(Option("tension_only", ("no", "yes"), "whether it can push"),),
)

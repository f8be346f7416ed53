"""Machines with an effect on every element that takes it, at a size that matters."""

from __future__ import annotations

from collections.abc import Iterator

import stiffmap as sm
from stiffmap.effects import get, kinds
from stiffmap.effects.types import EffectType, Place

LARGE: dict[str, dict[str, object]] = {
    "dead_zone": {"half_width": 5e-6},
    "friction": {"force": 5.0, "branch": "loading"},
    "hardening": {"cubic": 1e13},
    "length": {"error": 2e-5},
    "tilt": {"angle_x": 5e-4, "angle_y": -3e-4},
    "straightness": {"amplitude": 1e-5, "period": 0.4, "phase": 0.5},
    "joint_friction": {"torque": 0.1, "branch": "loading"},
    "joint_compliance": {"translation": 1e-9, "rotation": 1e-7},
}
"""Values (SI) of kinds whose typical size is small; the others have their typical size."""


def values_at(machine: sm.Machine, effect: EffectType, place: Place) -> dict[str, object]:
    """Parameters of one place: those of `LARGE`, or the typical size away from where the effect vanishes."""
    if effect.kind in LARGE:
        return LARGE[effect.kind]
    out: dict[str, object] = {}
    for p in effect.parameters_at(machine.description, *place):
        if p.name in effect.one_of[1:] or (p.default is not None and not p.fitted):
            continue
        out[p.name] = min(max((p.null or 0.0) + p.scale, p.lower), p.upper)
    return out


def widest(places: list[Place]) -> list[Place]:
    """Each element once, in all the legs that have it."""
    out: dict[str, Place] = {}
    for element, legs in places:
        if element not in out or len(legs) > len(out[element][1]):
            out[element] = (element, legs)
    return list(out.values())


def machines_with_effects(machine: sm.Machine) -> Iterator[tuple[str, sm.Machine]]:
    """Kind and machine, for each kind that some element takes."""
    for kind in kinds():
        effect = get(kind)
        if effect.apply is None:
            continue
        changed, found = machine, 0
        for element, legs in widest((effect.tried or effect.places)(machine.description)):
            given = {"legs": legs} if legs else {}
            try:
                changed = changed.with_effect(
                    kind, element=element, **given, **values_at(machine, effect, (element, legs))
                )
                changed.compiled  # noqa: B018
            except sm.StiffmapError:
                continue
            found += 1
        if found:
            yield kind, changed

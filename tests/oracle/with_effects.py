"""Machines with an effect at every place that takes it, at a size that matters: for oracles and benchmarks."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import stiffmap as sm
from stiffmap.model.effects import get
from stiffmap.model.effects.types import EffectType, Place

VALUES: dict[str, dict[str, object]] = {
    "dead_zone": {"half_width": 2e-5},
    "friction": {"force": 20.0, "torque": 2.0, "branch": "loading"},
    "hardening": {"cubic": 1e13},
    "length": {"error": 3e-4},
    "tilt": {"angle_x": 2e-3, "angle_y": -1e-3},
    "straightness": {"amplitude": 4e-5, "period": 0.3, "phase": 0.4},
    "position_offset": {"error_x": 2e-4, "error_z": -1e-4},
    "zero_offset": {"error": 3e-4},
    "periodic_error": {"amplitude": 3e-5, "period": 0.02, "phase": 0.3},
    "lead_error": {"slope": 2e-4},
    "joint_friction": {"torque": 0.2, "force": 2.0, "branch": "loading"},
    "joint_compliance": {"translation": 1e-9, "rotation": 1e-7},
    "joint_clearance": {"radius": 5e-6},
    "compliance": {"scale": 1.3},
    "bilinear": {"ratio": 0.5, "knee": 100.0},
    "tabulated": {"step": 2e-5, "factor_1": 0.6, "factor_2": 0.9, "factor_3": 1.2, "factor_4": 1.3},
    "position_dependent_compliance": {"slope": 0.1},
    "axis_tilt": {"angle_x": 1e-3, "angle_y": 2e-3},
    "leg_tilt": {"angle_x": 1e-3, "angle_z": -2e-3},
    "length_difference": {"difference": 1e-4},
    "parallelogram_width": {"error": 1e-4},
    "parallelogram_parallelism": {"angle_x": 1e-3, "angle_y": 1e-3},
    "tcp_offset": {"error_x": 1e-3, "error_z": 2e-3},
    "base_compliance": {"translation": 1e-8, "rotation": 1e-7},
    "tool_compliance": {"translation": 1e-8, "rotation": 1e-7},
    "preload": {"rest_x": 1e-5},
    "thermal_growth": {"coefficient": 1.2e-5, "temperature_difference": 8.0},
    "payload": {"mass": 3.0, "com_z": -0.05},
}
"""Values (SI) by kind; of a force and a torque the one that the place takes. Other kinds have their typical size."""


def with_effect(
    machine: sm.Machine, kind: str, places: Iterable[Place] | None = None
) -> tuple[sm.Machine | None, tuple[str, ...]]:
    """The machine with an effect of a kind at every place (each element once, in all its legs), and why places
    refused it; None where all did. `places`: None for all that the kind names."""
    effect = get(kind)
    out, refused = machine, []
    for element, legs in widest(effect.places(machine.description) if places is None else places):
        values = values_at(effect, machine, (element, legs))
        try:
            changed = out.with_effect(kind, element=element, legs=list(legs) or None, **values)
            changed.compiled  # noqa: B018 - what the core refuses
        except sm.StiffmapError as error:
            refused.append(f"{element}: {error}")
        else:
            out = changed
    return (out if out is not machine else None), tuple(refused)


def widest(places: Iterable[Place]) -> list[Place]:
    """Each element once, in all the legs that have it."""
    out: dict[str, tuple[str, ...]] = {}
    for element, legs in places:
        out[element] = max(out.get(element, ()), legs, key=len)
    return list(out.items())


def values_at(effect: EffectType, machine: sm.Machine, place: Place) -> dict[str, Any]:
    """Parameters of one place: those of `VALUES`, or the typical size away from where the effect vanishes."""
    here = effect.parameters_at(machine.description, *place)
    if effect.kind in VALUES:
        other = [p.name for p in here if effect.one_of and not p.fitted]
        return {n: v for n, v in VALUES[effect.kind].items() if n not in other}
    out: dict[str, Any] = {}
    for p in here:
        if p.name in effect.one_of[1:] or (p.default is not None and not p.fitted):
            continue
        out[p.name] = min(max((p.null or 0.0) + p.scale, p.lower), p.upper)
    return out

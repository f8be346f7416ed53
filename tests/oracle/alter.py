"""A task with an effect somewhere, and slopes of its displacement beside differences of the oracle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.model.effects import get

from .cartesian.solve import Machine, Unsupported
from .tasks import Task
from .with_effects import VALUES, values_at, widest

RUBBING = {"friction", "joint_friction", "dead_zone", "joint_clearance"}
KINDS = tuple(k for k in VALUES if k not in RUBBING)
SLOPES = (
    "zero_offset",
    "compliance",
    "position_offset",
    "length",
    "lead_error",
    "preload",
    "axis_tilt",
    "leg_tilt",
)
STEP = 1e-2
"""Of a typical size."""


def with_one_effect(task: Task, rng: np.random.Generator) -> tuple[Task, str]:
    """An effect of a random kind at a random place, and which; the task itself where none fits."""
    machine = sm.Machine(task.description)
    for kind in rng.permutation(KINDS):
        effect = get(str(kind))
        places = widest(effect.places(task.description))
        if not places:
            continue
        element, legs = places[int(rng.integers(len(places)))]
        values = values_at(effect, machine, (element, legs))
        try:
            changed = machine.with_effect(str(kind), element=element, legs=list(legs) or None, **values)
            Machine(changed.description)
        except (sm.StiffmapError, Unsupported):
            continue
        return replace(task, description=changed.description), f"{kind} at {element}"
    return task, ""


@dataclass(frozen=True)
class Slope:
    """Of the displacement in one number of an effect; the difference relative to the largest entry."""

    name: str
    off: float
    noise: float
    """Of the oracle's differences."""


def slopes(task: Task, rng: np.random.Generator) -> list[Slope]:
    """By the core and by central differences of the oracle, of one effect at its null value."""
    machine = sm.Machine(task.description)
    if task.pose is None:
        return []
    for kind in rng.permutation(SLOPES):
        effect = get(str(kind))
        places = widest(effect.places(task.description))
        if places:
            element, legs = places[int(rng.integers(len(places)))]
            return compared(task, machine, str(kind), element, legs)
    return []


def compared(task: Task, machine: sm.Machine, kind: str, element: str, legs: tuple[str, ...]) -> list[Slope]:
    here = [
        p for p in get(kind).parameters_at(task.description, element, legs) if p.fitted and p.null is not None
    ]
    if not here or task.pose is None:
        return []
    at: dict[str, Any] = {"element": element, "legs": list(legs) or None}
    null: dict[str, Any] = {p.name: p.null for p in here}
    load: dict[str, Any] = {"load_type": task.kind, "gravity": task.loads.gravity, "threads": 1,
                            "wrenches": {n: [*f, 0, 0, 0] for n, f in task.loads.at_points.items()}}  # fmt: skip
    wrench = [*task.loads.force, *task.loads.moment]
    given = {k: v for k, v in at.items() if v is not None}
    try:
        machine.with_effect(kind, **at, **null)
    except sm.StiffmapError:  # a place that the effect refuses
        return []
    s = machine.solve(
        task.pose.p, wrench, rotation=task.pose.r, derivatives=[(kind, {**given, **null})], **load
    )
    if s.status != sm.Status.CONVERGED:
        return []
    out = []
    for p in here:
        name = next(n for n in s.derivatives if n.split()[-1] == p.name)
        step = STEP * p.scale
        differences = []
        for h in (step, 2 * step):
            ends = []
            for sign in (1, -1):
                changed = machine.with_effect(kind, **at, **{**null, p.name: (p.null or 0.0) + sign * h})
                try:
                    bodies = Machine(changed.description)
                    ends.append(bodies.solve(task.loads, task.pose, None, task.kind).displacement)
                except Unsupported:  # found only where it moves
                    return []
            differences.append((ends[0] - ends[1]) / (2 * h))
        best = (4 * differences[0] - differences[1]) / 3
        size = np.r_[[np.abs(best[:3]).max()] * 3, [max(np.abs(best[3:]).max(), np.abs(best[:3]).max())] * 3]
        size = np.maximum(size, 1e-30)
        moved = 1e-13 / step  # what round-off of a displacement makes of a slope
        noise = float((np.abs(best - differences[0]) / size).max()) + float((moved / size).max())
        out.append(Slope(name, float((np.abs(s.derivatives[name] - best) / size).max()), noise))
    return out

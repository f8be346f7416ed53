"""Effects of a recorded temperature: solved at three temperatures, interpolated between them.

Growth by heat is a strain of about 1e-5 per kelvin; what a parabola through three temperatures leaves
out is of third order in it, far below any reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stiffmap import effects
from stiffmap.description import AppliedEffect
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats

Terms = tuple[AppliedEffect, ...]


def uses_temperature(kind: str) -> bool:
    """Whether an effect needs a recorded temperature."""
    return "temperature" in effects.get(kind).needs


def temperature_change(experiment: Experiment) -> Floats:
    """(n,) K against the reference temperature of the file, or against the first reading's."""
    if experiment.temperature is None:
        raise StiffmapError(f"{experiment.name}: missing column 'temperature'")
    first = float(experiment.temperature[0])
    reference = first if experiment.reference_temperature is None else experiment.reference_temperature
    return experiment.temperature - reference


def at_temperatures(plan: Experiment, terms: Terms, solve: Callable[[Experiment, Terms], Floats]) -> Floats:
    """(n, 6) motions with every row at its own temperature."""
    change = temperature_change(plan)
    low, high = float(change.min()), float(change.max())
    nodes = np.array([low, (low + high) / 2, high]) if high - low > 1e-9 else np.array([low])
    solved = [solve(plan, tuple(_heated(t, float(node)) for t in terms)) for node in nodes]
    weights = [_lagrange(change, nodes, i) for i in range(len(nodes))]
    return np.asarray(sum(w[:, None] * s for w, s in zip(weights, solved, strict=True)))


def _lagrange(x: Floats, nodes: Floats, i: int) -> Floats:
    others = np.delete(nodes, i)
    return np.asarray(np.prod((x[:, None] - others) / (nodes[i] - others), axis=1))


def _heated(term: AppliedEffect, change: float) -> AppliedEffect:
    effect = effects.get(term.kind)
    if "temperature" not in effect.needs:
        return term
    name = next(p.name for p in effect.parameters if not p.fitted and p.unit == "K")
    return replace(term, parameters=tuple({**dict(term.parameters), name: change}.items()))

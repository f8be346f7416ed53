"""Could other values of what the paper leaves open explain its numbers? The foot and the actuators varied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.model.description import Element, Joint, Spring
from stiffmap.solve.machine import Machine

SCALES = ((0, 1), (1, 0), (0, 0), (1, 1), (10, 1), (1, 10), (0, 10))
"""Factors on the compliances of foot and actuator, 0 is rigid."""


def ratio_range(machine: Machine, position: Sequence[float]) -> tuple[float, float]:
    """Least and largest max/min deflection in the xy plane (zero load) over the variants."""
    ratios = []
    for foot, actuator in SCALES:
        c = varied(machine, foot, actuator).solve(position).compliance[:2, :2]
        size = np.linalg.svd(c, compute_uv=False)
        ratios.append(float(size[0] / size[1]))
    return min(ratios), max(ratios)


def varied(machine: Machine, foot: float, actuator: float) -> Machine:
    """The machine with foot and actuator compliances multiplied."""
    legs = tuple(
        replace(leg, elements=tuple(_varied(e, foot, actuator) for e in leg.elements))
        for leg in machine.description.legs
    )
    return Machine(replace(machine.description, legs=legs))


def _varied(e: Element, foot: float, actuator: float) -> Element:
    if isinstance(e, Spring) and e.name == "foot" and e.compliance is not None:
        return replace(e, compliance=tuple(tuple(foot * v for v in row) for row in e.compliance))
    if isinstance(e, Joint) and e.actuated and e.law is not None:
        law = replace(e.law, stiffness=e.law.stiffness / actuator) if actuator else None
        return replace(e, law=law)
    return e

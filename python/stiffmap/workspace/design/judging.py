"""One design: objectives and constraint violations, from measures on a coarse grid of poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.workspace.design.problem import Design
from stiffmap.workspace.performance.poses import read_box
from stiffmap.workspace.performance.registry import Case, Measure, get_measure

IMPOSSIBLE = 1e6
"""Objective and violation of a design that cannot be built or reaches nothing."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Objectives to be minimised, and violations relative to each bound (positive: broken)."""

    objectives: Floats
    violations: Floats
    values: dict[str, float]
    """Worst value of every measure asked for, SI."""
    reason: str = ""


def judge(design: Design, x: Floats) -> Judged:
    """Evaluate a vector of variables; a machine that cannot be is infeasible, never an error."""
    names = list(dict.fromkeys([*design.model.objectives, *(n for n, _ in design.constraints)]))
    try:
        values = values_of(design, design.quick_machine(x), names)
    except StiffmapError as error:
        return Judged(
            np.full(len(design.model.objectives), IMPOSSIBLE),
            np.full(len(design.constraints), IMPOSSIBLE),
            {},
            str(error),
        )
    objectives = np.array([_minimised(get_measure(n), values[n]) for n in design.model.objectives])
    violations = np.array(
        [violation(bound.margin(values[n]), bound.at_least, bound.at_most) for n, bound in design.constraints]
    )
    return Judged(objectives, violations, values)


def values_of(design: Design, machine: Machine, names: list[str]) -> dict[str, float]:
    """Worst values of measures on the search's nodes, SI."""
    task = design.requirements
    low, high = read_box(machine, None)
    if task.box is not None:
        middle, half = (low + high) / 2, np.array(task.box) / 2
        low, high = middle - half, middle + half
    nodes = design.model.search.nodes
    case = Case(
        machine,
        low,
        high,
        task.force or 100.0,
        task.plane,
        nodes=nodes,
        coarse=nodes,
        quick=True,
        threads=1,
        toolpath=design.toolpath,
        clearance=task.clearance,
        deflection=task.deflection,
    )
    return {n: get_measure(n).compute(case).worst for n in names}


def _minimised(measure: Measure, value: float) -> float:
    if not np.isfinite(value):
        return IMPOSSIBLE
    return -value if measure.better == "high" else value


def violation(margin: float, at_least: float | None, at_most: float | None) -> float:
    """Minus the margin, relative to the bound."""
    size = max(abs(at_least or 0.0), abs(at_most or 0.0)) or 1.0
    return -margin / size if np.isfinite(margin) else IMPOSSIBLE

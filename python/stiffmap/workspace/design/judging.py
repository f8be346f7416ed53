"""One design: objectives and constraint violations, from measures on a coarse grid of poses; chosen ones made
better by gradients: SLSQP of scipy, slopes by differences of the core."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine
from stiffmap.workspace.design.problem import DesignProblem
from stiffmap.workspace.performance.registry import Case, Measure, get_measure
from stiffmap.workspace.performance.requirements import Bound

IMPOSSIBLE = 1e6  # objective and violation of a design that cannot be built or reaches nothing


@dataclass(frozen=True, eq=False)
class Judged:
    """Objectives to be minimised, and violations relative to each bound (positive: broken)."""

    objectives: Floats
    violations: Floats
    values: dict[str, float]
    """Worst value of every measure asked for, SI."""
    reason: str = ""


def judge(design: DesignProblem, x: Floats) -> Judged:
    """Evaluate a vector of variables; a machine that cannot be is infeasible, never an error."""
    try:
        values = values_of(design, design.machine(x))
    except StiffmapError as error:
        f, g = (np.full(len(of), IMPOSSIBLE) for of in (design.model.objectives, design.constraints))
        return Judged(f, g, {}, str(error))
    objectives = np.array([_minimised(get_measure(n), values[n]) for n in design.model.objectives])
    violations = np.array([violation(bound, values[n]) for n, bound in design.constraints])
    return Judged(objectives, violations, values)


def values_of(design: DesignProblem, machine: Machine) -> dict[str, float]:
    """Worst values of all measures that the design asks for, on the search's nodes, SI."""
    task = design.requirements
    low, high = machine.workspace
    if task.box is not None:
        middle, half = (low + high) / 2, np.array(task.box) / 2
        low, high = middle - half, middle + half
    nodes = design.model.search.nodes
    case = Case(
        machine, low, high, task.force or 100.0, task.plane, transmission=task.transmission, proportions=task.proportions,
        nodes=nodes, coarse=nodes, quick=True, threads=1, toolpath=design.toolpath, clearance=task.clearance,
        deflection=task.deflection,
    )  # fmt: skip
    return {n: get_measure(n).compute(case).worst for n in design.measures}


def _minimised(measure: Measure, value: float) -> float:
    if not np.isfinite(value):
        return IMPOSSIBLE
    return -value if measure.better == "high" else value


def violation(bound: Bound, value: float) -> float:
    """Minus the margin, relative to the bound."""
    margin = bound.margin(value)
    size = max(abs(bound.at_least or 0.0), abs(bound.at_most or 0.0)) or 1.0
    return -margin / size if np.isfinite(margin) else IMPOSSIBLE


STEP = 1e-4  # of a variable's range: differences over it give slopes
ROUNDS = 40
RADII = (0.3, 0.1, 0.03, 0.03)
"""Of every variable's range: how far one run may go from the best design so far."""
TIGHT = 5e-4
"""Of each bound: how far inside constraints are asked to hold, so that they do when measured in full."""


def refine(design: DesignProblem, x: Floats, weights: Floats, *, keep: bool = False) -> tuple[Floats, Judged]:
    """The design (variables,) nearby with the least weighted sum of objectives (objectives,), and its judgement.

    Constraints hold; catalogue rows stay; `keep`: no objective may become worse. Where nothing better is found, the design itself.
    """
    low, high = design.bounds
    moves = np.arange(len(design.model.variables))
    known: dict[bytes, Judged] = {}
    first = judge(design, x)
    # a measure that is exactly at its bound, as a box no larger than asked for, jumps: only what comes out is judged
    slides = first.violations != 0
    scale = np.where(np.abs(first.objectives) > 0, np.abs(first.objectives), 1.0)
    best, best_at = (first, x) if (first.violations <= 0).all() else (None, x)

    def at(y: Floats) -> Judged:
        nonlocal best, best_at
        full = x.copy()
        full[moves] = np.clip(low[moves] + y * (high - low)[moves], low[moves], high[moves])
        key = full.tobytes()
        if key not in known:
            found = known[key] = judge(design, full)
            kept = (found.violations <= np.where(slides, -TIGHT, 0.0)).all()
            good = kept and (found.objectives < IMPOSSIBLE).all()
            good &= not keep or bool((found.objectives <= first.objectives).all())
            if good and (best is None or goal_of(found) < goal_of(best)):
                best, best_at = found, full
        return known[key]

    def goal_of(j: Judged) -> float:
        return float(weights @ (j.objectives / scale))

    def rows(y: Floats) -> Floats:
        """Objective, then minus each violation."""
        j = at(y)
        room = -np.minimum(j.violations, 10.0)[slides] - 1.1 * TIGHT
        worse = (first.objectives - j.objectives) / scale if keep else np.zeros(0)
        return np.concatenate([[goal_of(j)], room, np.maximum(worse, -10.0)])

    def slopes(y: Floats) -> Floats:
        """(1 + constraints, variables), one-sided, away from the nearer bound."""
        here, out = rows(y), []
        for i in range(len(y)):
            step = np.zeros_like(y)
            step[i] = STEP if y[i] < 0.5 else -STEP
            out.append((rows(y + step) - here) / step[i])
        return np.stack(out, axis=1)

    for radius in RADII:
        begin = ((best_at - low) / (high - low))[moves]
        reach = [(max(0.0, y - radius), min(1.0, y + radius)) for y in begin]
        minimize(
            lambda y: rows(y)[0], begin, jac=lambda y: slopes(y)[0], bounds=reach, method="SLSQP",
            constraints={"type": "ineq", "fun": lambda y: rows(y)[1:], "jac": lambda y: slopes(y)[1:]}
            if slides.any() or keep else (),
            options={"maxiter": ROUNDS, "ftol": 1e-7},
        )  # fmt: skip
    return best_at, best if best is not None else first

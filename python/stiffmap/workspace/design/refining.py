"""Chosen designs made better by gradients: SLSQP of scipy, slopes by differences of the core."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from stiffmap.common.broadcasting import Floats
from stiffmap.workspace.design.judging import IMPOSSIBLE, Judged, judge
from stiffmap.workspace.design.problem import Design

STEP = 1e-4
"""Of a variable's range: differences over it give slopes."""
ROUNDS = 40
RADII = (0.3, 0.1, 0.03, 0.03)
"""Of every variable's range: how far one run may go from the best design so far."""
TIGHT = 5e-4
"""Of each bound: how far inside constraints are asked to hold, so that they do when measured in full."""


def refine(design: Design, x: Floats, weights: Floats, *, keep: bool = False) -> tuple[Floats, Judged]:
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
            good = (found.violations <= np.where(slides, -TIGHT, 0.0)).all() and (
                found.objectives < IMPOSSIBLE
            ).all()
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

    cache: dict[bytes, Floats] = {}

    def slope(y: Floats) -> Floats:
        key = y.tobytes()
        if key not in cache:
            cache[key] = slopes(y)
        return cache[key]

    for radius in RADII:
        begin = ((best_at - low) / (high - low))[moves]
        reach = [(max(0.0, y - radius), min(1.0, y + radius)) for y in begin]
        minimize(
            lambda y: rows(y)[0], begin, jac=lambda y: slope(y)[0], bounds=reach, method="SLSQP",
            constraints={"type": "ineq", "fun": lambda y: rows(y)[1:], "jac": lambda y: slope(y)[1:]}
            if slides.any() or keep else (),
            options={"maxiter": ROUNDS, "ftol": 1e-7},
        )  # fmt: skip
    return best_at, best if best is not None else first

"""Causes of a tap test that have a name, by the inference of all other readings (docs/theory.md V8).

Every effect that changes stiffness or mass may be at every place of the machine. A frequency bends with the size of an effect, so each
place has the changes by many sizes as its shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.free import Free
from stiffmap.identification.inference.names import put_instead, searched
from stiffmap.identification.inference.places import Place, shape_of
from stiffmap.identification.inference.verdict import judged
from stiffmap.identification.numbers.unknowns import Unknown
from stiffmap.identification.taps.fit import FittedCauses, free_number, in_si
from stiffmap.identification.taps.problem import Causes, TapsProblem

FACTORS = (-1.5, -0.8, -0.4, -0.15, 0.15, 0.4, 0.8, 1.3, 1.8, 2.4)
"""Logarithms of a factor at which its changes are predicted."""
SIZES = (-10.0, -3.0, -1.0, 1.0, 3.0, 10.0, 30.0)
"""The same of a number whose null is zero, in typical sizes."""
BETWEEN = 16
"""Sizes from one of these to the next, both among them."""
REFINED = 4
"""Causes in the stead of one, and starts of the fit without any, that are fitted; effort only."""


def named_causes(problem: TapsProblem, tried: Sequence[Candidate], at: FittedCauses) -> list[Causes]:
    """Further causes that have a name where readings follow the uncertain numbers along straight lines from a fit, and what would
    do in the stead of each; all of them, and some, with the causes of the fit and without."""
    columns = columns_of(problem, tried, at)

    def predict(chosen: Sequence[Chosen]) -> Floats:
        try:
            there = problem.residual([*at.causes, *_values(chosen)], at.lines.x)
            return columns.rotated(there - at.lines.residual)
        except StiffmapError:
            return np.full(len(columns), np.nan)

    search = searched(columns, predict)
    named = judged(columns, search).named
    own = _values([n.chosen for n in named])
    sets = [own]
    for k, n in enumerate(named):
        instead = _values([put_instead(search.best.fit, n.chosen, p) for p in n.equivalents[:REFINED]])
        sets += [[*own[:k], v, *own[k + 1 :]] for v in instead]
    some = (part for s in sets for k in range(1, len(s) + 1) for part in combinations(s, k))
    both = (s for part in some for s in (part, (*at.causes, *part)))
    return list({frozenset(c for c, _ in s): s for s in both}.values())


def columns_of(problem: TapsProblem, tried: Sequence[Candidate], at: FittedCauses) -> Columns:
    """The readings, by their noise, as the inference takes them."""
    lines, taken = at.lines, [c for c, _ in at.causes]
    m = len(lines.residual)
    spared = Free.across(np.linalg.qr(at.own)[0], np.eye(m))  # causes of the fit move with further ones
    free = spared.matrix
    residual = free.T @ (lines.jacobian @ lines.x - lines.residual)
    bare = Columns.bare(problem.plan, problem.row[problem.used], np.zeros(m, np.intp), spared, residual)
    unknowns = tuple(Unknown(key, key.rpartition("/")[2], "", u) for key, _, u in problem.numbers)
    found = (place_of(problem, c, at, free) for c in tried if c not in taken)
    places = tuple(p for p in found if p.shapes)
    return replace(bare, unknowns=unknowns, numbers=free.T @ lines.jacobian, places=places)


def place_of(problem: TapsProblem, c: Candidate, at: FittedCauses, free: Floats) -> Place:
    """A candidate with the changes of the readings by its sizes, predicted at some and interpolated between them."""
    lines, p = at.lines, c.parameters[0]
    changes = {0.0: np.zeros(len(lines.residual))}
    for t in FACTORS if p.null == 1.0 else SIZES:
        with suppress(StiffmapError):
            if free_number(p, p.lower) < t < free_number(p, p.upper):
                changes[t] = problem.residual([*at.causes, (c, in_si(p, t))], lines.x) - lines.residual
    knots = sorted(changes)
    sizes = np.unique([np.linspace(*ends, BETWEEN) for ends in pairwise(knots)])
    found = CubicSpline(knots, [changes[t] for t in knots])(sizes) if len(knots) > 1 else ()
    shapes = []
    for t, change in zip(sizes, found, strict=True):
        step = (in_si(p, t) - float(p.null or 0.0)) / p.scale
        if step:
            line = change[None] / step
            shapes.append(shape_of(Variant(c, line, np.array([np.sign(step)])), free.T @ line.T))
    return Place(c, tuple(s for s in shapes if s is not None))


def _values(chosen: Sequence[Chosen]) -> Causes:
    """Causes with their values, SI, within their bounds."""
    every = ((c.place.candidate, *c.strengths[0]) for c in chosen)
    return [(cause, float(np.clip(value, p.lower, p.upper))) for cause, p, value in every]

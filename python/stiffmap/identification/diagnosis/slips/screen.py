"""How much of a misfit the best single part of the machine takes away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.inference.places import Shape, shape_of
from stiffmap.model.effects import get


@dataclass(frozen=True, eq=False)
class Screen:
    """The directions of all parts of the machine in whitened readings (N,)."""

    problem: Problem
    use: Integers
    """(R,) the problem's readings among those of the variants."""
    shapes: tuple[Shape, ...]

    @staticmethod
    def of(problem: Problem, use: Integers, variants: Sequence[Variant]) -> Screen:
        """Of variants that are no fault of the measurement."""
        parts = [v for v in variants if not get(v.candidate.kind).measurement]
        found = (shape_of(v, problem.white_lines(v.lines(use))) for v in parts)
        return Screen(problem, use, tuple(s for s in found if s is not None))

    def gain(self, residual: Floats) -> float:
        """What the best part takes from chi-square of a residual (N,), its strengths within their bounds."""
        along = [s.directions.T @ residual for s in self.shapes]
        gains = np.array(
            [
                a @ a if not s.sign or s.sign * a[0] > 0.0 else 0.0
                for s, a in zip(self.shapes, along, strict=True)
            ]
        )
        best = (k for k in np.argsort(-gains) if self._is_possible(self.shapes[k].variant, residual))
        return float(gains[k]) if (k := next(best, None)) is not None else 0.0

    def _is_possible(self, v: Variant, residual: Floats) -> bool:
        """Whether the strengths that explain most are within the bounds of their parameters."""
        if v.start is not None:
            return True
        numbers = v.candidate.linear
        white = self.problem.white_lines(v.lines(self.use))
        strengths = np.linalg.lstsq(white, residual, rcond=1e-5)[0]
        values = [float(p.null or 0.0) + float(x) * p.scale for p, x in zip(numbers, strengths, strict=True)]
        return all(p.lower <= x <= p.upper for p, x in zip(numbers, values, strict=True))

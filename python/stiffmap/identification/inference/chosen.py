"""An effect at a place that is in the model: its strengths and shape, and how they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.parts import Part
from stiffmap.identification.inference.places import Place, possible
from stiffmap.model.effects import Parameter


@dataclass(frozen=True, eq=False)
class Chosen:
    """A place that is in the model, at one of its shapes."""

    place: Place
    shape: int
    part: Part
    values: Floats
    """(p,) strengths, in the scales of the linear parameters."""
    refined: tuple[tuple[str, float], ...] = ()
    """Values (SI) of parameters of the shape, where an optimum has others than the grid."""

    @staticmethod
    def at(place: Place, shape: int) -> Chosen:
        """At one of the shapes, of no strength yet."""
        part = Part(str(place.candidate), "effect", factor=place.shapes[shape].factor)
        return Chosen(place, shape, part, np.zeros(0))

    @property
    def variant(self) -> Variant:
        """Its columns."""
        return self.place.shapes[self.shape].variant

    @property
    def shaped(self) -> tuple[tuple[Parameter, float], ...]:
        """Parameters of the shape with their values on the grid, SI."""
        given = dict(self.variant.shape)
        return tuple((p, given[p.name]) for p in self.place.candidate.shape if p.name in given)

    @property
    def strengths(self) -> tuple[tuple[Parameter, float], ...]:
        """Linear parameters with their values, SI; nothing where the strengths are not theirs."""
        return self.place.candidate.strengths(self.values)

    def lines(self, columns: Columns) -> Floats:
        """(N, p) m, rad: its columns, per scale of each linear parameter."""
        return columns.lines(self.variant)

    def rotated(self, columns: Columns) -> Floats:
        """(m, p) change of the readings per scale of each linear parameter, in what frames leave free."""
        return columns.rotated(self.lines(columns))

    def by_posterior(self, fit: Fit) -> Chosen:
        """With the strengths of its posterior mean in a fit."""
        values = np.linalg.lstsq(self.rotated(fit.columns), fit.mean(self.part), rcond=1e-9)[0]
        return replace(self, values=np.asarray(values))

    @property
    def is_possible(self) -> bool:
        """Whether all strengths lie within what their parameters can be."""
        return not self.is_too_large and all(
            low <= x <= high for p, x in self.strengths for low, high in [possible(p)]
        )

    @property
    def is_too_large(self) -> bool:
        """Whether no machine can have it so large."""
        return float(np.abs(self.values).max(initial=0.0)) > self.variant.most

    @property
    def whole(self) -> Floats:
        """(p + q,) strengths and shape, in scales."""
        return np.append(self.values, [v / p.scale for p, v in self.shaped])

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """(p + q,) least and largest values of strengths, in scales, and of the shape; infinite for strengths that are no parameters."""
        number = len(self.variant.sign)
        low, high = np.full(number, -np.inf), np.full(number, np.inf)
        if len(self.place.candidate.linear) == number:
            both = [(*possible(p), float(p.null or 0.0), p.scale) for p in self.place.candidate.linear]
            low = np.array([(a - null) / scale for a, _, null, scale in both])
            high = np.array([(b - null) / scale for _, b, null, scale in both])
        low, high = np.maximum(low, -self.variant.most), np.minimum(high, self.variant.most)
        shape = [p for p, _ in self.shaped]
        return (
            np.append(low, [p.lower / p.scale for p in shape]),
            np.append(high, [p.upper / p.scale for p in shape]),
        )

    def moved(self, x: Floats) -> Chosen:
        """At strengths and shape x (p + q,)."""
        number = len(self.variant.sign)
        refined = zip(self.shaped, x[number:], strict=True)
        return replace(
            self, values=x[:number], refined=tuple((p.name, float(v) * p.scale) for (p, _), v in refined)
        )


def all_moved(chosen: Sequence[Chosen], x: Floats) -> tuple[Chosen, ...]:
    """The effects at strengths and shapes x, one after the other."""
    ends = np.cumsum([len(c.variant.sign) + len(c.shaped) for c in chosen])[:-1]
    return tuple(c.moved(part) for c, part in zip(chosen, np.split(x, ends), strict=True))

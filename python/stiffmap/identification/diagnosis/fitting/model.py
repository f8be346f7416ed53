"""A set of effects with their values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import basis
from stiffmap.identification.diagnosis.candidates.candidates import Candidate
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import Parameter

STEP = 1e-3  # of a parameter's scale, for tangents
VISIBLE = 0.03
"""Whitened length per scale below which a parameter is not seen: 100 scales would make 3 sigma."""


@dataclass(frozen=True, eq=False)
class Model:
    """Candidates and the values of all their parameters, one after the other (in scales)."""

    candidates: tuple[Candidate, ...] = ()
    values: Floats = field(default_factory=lambda: np.zeros(0))
    chi2: float = np.inf
    jacobian: Floats | None = None
    """(N, k) whitened, at `values`."""
    residual: Floats | None = None
    """(N,) whitened."""
    held: tuple[int, ...] = ()
    """Values that no fit moves: the readings do not feel them where the effect begins."""
    failure: str = ""
    """Why the machine cannot be built or solved with the model; chi2 is then infinite."""
    given_up: bool = False
    """Whether it failed for the effort that its predictions are."""

    @property
    def usable(self) -> bool:
        """Whether a fit came to an end: there are a residual and a Jacobian."""
        return self.residual is not None and bool(np.isfinite(self.chi2))

    @property
    def parameters(self) -> list[Parameter]:
        """Of all candidates, in the order of the values."""
        return [p for c in self.candidates for p in c.parameters]

    @property
    def scales(self) -> Floats:
        """(k,) SI size of one unit of each value."""
        return np.array([p.scale for p in self.parameters])

    @property
    def si(self) -> Floats:
        """(k,) values in SI."""
        return self.values * self.scales

    @property
    def freedom(self) -> int:
        """Number of parameters that the readings feel; one that they do not is no parameter of the fit."""
        return sum(self.sizes())

    def sizes(self) -> list[int]:
        """Per candidate the number of its parameters that the readings feel, at least one."""
        if self.jacobian is None:
            return [len(c.parameters) for c in self.candidates]
        felt = np.linalg.norm(self.jacobian, axis=0) > VISIBLE
        return [max(1, int(felt[part].sum())) for part in self.parts()]

    def bounds(self) -> tuple[Floats, Floats]:
        """Bounds of the values, in scales."""
        return (
            np.array([p.lower / p.scale for p in self.parameters]),
            np.array([p.upper / p.scale for p in self.parameters]),
        )

    def terms(self, values: Floats | None = None) -> tuple[AppliedEffect, ...]:
        """The effects with these values (in scales)."""
        si = (self.values if values is None else values) * self.scales
        out, at = [], 0
        for c in self.candidates:
            out.append(c.term(si[at : at + len(c.parameters)].tolist()))
            at += len(c.parameters)
        return tuple(out)

    def parts(self) -> list[slice]:
        """Where each candidate's values stand."""
        ends = np.cumsum([len(c.parameters) for c in self.candidates])
        return [slice(int(e) - len(c.parameters), int(e)) for c, e in zip(self.candidates, ends, strict=True)]

    def without(self, i: int) -> Model:
        """The model less one candidate, its other values as they are."""
        part = self.parts()[i]
        gone = range(part.start, part.stop)
        values = np.delete(self.values, part)
        held = tuple(k if k < part.start else k - len(gone) for k in self.held if k not in gone)
        return Model(self.candidates[:i] + self.candidates[i + 1 :], values, held=held)

    def plus(self, candidate: Candidate, values: Sequence[float] | Floats, held: Sequence[int] = ()) -> Model:
        """The model and one candidate more, its values in scales; `held` counts within the candidate."""
        more = tuple(len(self.values) + int(k) for k in held)
        return Model((*self.candidates, candidate), np.append(self.values, values), held=(*self.held, *more))

    def tangent(self) -> Floats:
        """(N, r) orthonormal basis of the fitted effects' directions."""
        return np.zeros((0, 0)) if self.jacobian is None else basis(self.jacobian)


def tangent_step(values: Floats, i: int, upper: float, size: float = STEP) -> float:
    """Difference step of value i: away from its upper bound."""
    return -size if values[i] + size > upper else size

"""Effects at places: what all of them would add to the evidence; one in the model of a search; one that is fitted to the readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import log_ndtr, ndtri

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Floats
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import Variant
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import SIZES
from stiffmap.identification.inference.parts import Part, gains, log_mean
from stiffmap.identification.inference.places import Place, Shape, of_every_two, possible, side_by_side
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import Parameter, get

PAIR_STRIDE = 3
"""Of the sizes that pairs are tried with: every third; effort only."""


def evidence(fit: Fit, places: tuple[Place, ...]) -> list[Floats]:
    """Per place, (shapes,) mean over sizes of the gain of evidence of an effect there, ln; worked out once for each fit."""
    new = [p for p in places if id(p) not in fit.gain]
    if new:
        spans = [p.span[0] for p in new]
        ends = np.cumsum([u.shape[1] for u in spans])[:-1]
        for p, white in zip(new, np.split(fit.white(np.hstack(spans)), ends, axis=1), strict=True):
            fit.gain[id(p)] = _of_place(fit, p, white)
    return [fit.gain[id(p)] for p in places]


def _of_place(fit: Fit, place: Place, white: Floats) -> Floats:
    """Of a place with its span (m, r) whitened."""
    span, factors = place.span
    shapes, rank = len(place.shapes), factors.shape[1] // len(place.shapes)
    along = (factors.T @ (span.T @ fit.solved)).reshape(shapes, rank)
    own = (np.linalg.qr(white, mode="r") @ factors).T.reshape(shapes, rank, -1)
    of_two = own @ own.transpose(0, 2, 1)
    inside, vectors = np.linalg.eigh(of_two)
    gain = gains(inside, np.einsum("iab,ia->ib", vectors, along))
    sign = np.array([s.sign for s in place.shapes])[:, None]
    if sign.any():  # of one direction each
        side = log_ndtr(sign * along[:, :1] * SIZES / np.sqrt(1.0 + of_two[:, 0, :1] * SIZES**2))
        gain = gain + np.where(sign == 0, 0.0, side + np.log(2.0))
    return log_mean(gain)


def of_pairs(fit: Fit, shapes: Sequence[Shape]) -> Floats:
    """(s, s) gain of evidence by every two of some shapes together, mean over both sizes; nothing of one with itself."""
    factor = side_by_side(shapes)
    m, s, rank = factor.shape
    z = (factor.reshape(m, -1).T @ fit.solved).reshape(s, rank)
    b2 = SIZES[::PAIR_STRIDE] ** 2
    root = np.sqrt(np.stack(np.meshgrid(b2, b2, indexing="ij"), axis=-1).reshape(-1, 2).repeat(rank, axis=1))
    first, second = np.tril_indices(s, -1)
    both = np.stack([first, second], axis=1)
    of_two = of_every_two(fit.white(factor.reshape(m, -1)), rank, both)[:, None]
    inner = np.eye(2 * rank) + root[:, :, None] * of_two * root[:, None, :]
    scaled = root * z[both].reshape(-1, 1, 2 * rank)
    solved = np.linalg.solve(inner, scaled[..., None])[..., 0]
    out = np.full((s, s), -np.inf)
    out[first, second] = log_mean(0.5 * np.sum(scaled * solved, axis=-1) - 0.5 * np.linalg.slogdet(inner)[1])
    return np.asarray(np.maximum(out, out.T))


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

    @property
    def term(self) -> AppliedEffect:
        """The effect with its strengths, SI, within their bounds."""
        given = dict(self.variant.shape) | dict(self.refined)
        given |= {p.name: float(np.clip(value, p.lower, p.upper)) for p, value in self.strengths}
        if self.variant.start is not None:
            given |= self.variant.start(self.values)
        return self.place.candidate.term_of(given)

    def rotated(self, columns: Columns) -> Floats:
        """(m, p) change of the readings per scale of each linear parameter, in what frames leave free."""
        return columns.rotated(columns.lines(self.variant))

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
        given = dict(self.refined)
        return np.append(self.values, [given.get(p.name, v) / p.scale for p, v in self.shaped])

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


WIDE = float(-ndtri(0.025))
"""Standard deviations of a 95 % interval to either side."""
AT_BOUND = 1e-3
"""Of a parameter's scale, within which it is at a bound."""


@dataclass(frozen=True, eq=False)
class Term:
    """An effect that is fitted: all its parameters, in their scales."""

    candidate: Candidate
    values: Floats
    """(q,)."""
    sd: Floats = field(default_factory=lambda: np.zeros(0))
    """(q,) their standard deviations at an optimum, everything else integrated out; infinite where the readings determine nothing."""

    @staticmethod
    def of(candidate: Candidate, term: AppliedEffect) -> Term:
        """With the values (SI) of an effect."""
        given = dict(term.parameters)
        found = [float(given.get(p.name, p.null or 0.0)) / p.scale for p in candidate.parameters]
        return Term(candidate, np.clip(np.array(found), *Term(candidate, np.zeros(0)).bounds))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """(q,) least and largest values."""
        both = [possible(p) if p.null is not None else (p.lower, p.upper) for p in self.candidate.parameters]
        scale = np.array([p.scale for p in self.candidate.parameters])
        low, high = (np.array(side, dtype=float) / scale for side in zip(*both, strict=True))
        return low, high

    def effect(self, values: Floats) -> AppliedEffect:
        """With other values."""
        p = self.candidate.parameters
        return self.candidate.term([float(v) * q.scale for v, q in zip(values, p, strict=True)])

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """(q,) lower and upper ends of 95 % intervals, whatever the bounds."""
        return self.values - WIDE * self.sd, self.values + WIDE * self.sd

    @property
    def nulls(self) -> Floats:
        """(q,) values at which the effect vanishes; NaN where there is none."""
        return np.array([np.nan if p.null is None else p.null / p.scale for p in self.candidate.parameters])

    @property
    def undetermined(self) -> Mask:
        """(q,) parameters whose interval is all that they can be, shapes at a bound, and strengths if all but idle ones are at one."""
        (low, high), (least, most) = self.bounds, self.ends
        shape = np.isnan(self.nulls)
        near = [(np.abs(self.values - b) < AT_BOUND) & (b != self.nulls) for b in (low, high)]
        at = near[0] | near[1]
        return np.asarray(((least <= low) & (most >= high)) | (at & (shape | (at | self.idle)[~shape].all())))

    @property
    def idle(self) -> Mask:
        """(q,) strengths whose interval includes none at all."""
        least, most = self.ends
        return np.asarray((least <= self.nulls) & (self.nulls <= most))

    @property
    def spare(self) -> Mask:
        """(q,) parameters that are not determined and that the effect can do without: at their null, or their default."""
        p, vector = self.candidate.parameters, get(self.candidate.kind).vector
        may = [q.default is not None or q.name in vector for q in p]
        shape = np.isnan(self.nulls)
        idle = self.idle & (len(self.candidate.linear) > 1)
        return np.asarray(self.undetermined & may & (shape | idle))

    def without(self, k: int) -> Term:
        """Without one parameter, from the same values."""
        p = self.candidate.parameters
        return Term(replace(self.candidate, parameters=p[:k] + p[k + 1 :]), np.delete(self.values, k))

"""Places of effects: candidates with the directions in which they show, those that show alike under one name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import qr

from stiffmap.experiment.experiment import Floats, Integers
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import CandidatePlan, Variant
from stiffmap.identification.inference.constants import LARGEST_ERROR
from stiffmap.model.description import Joint, MachineDescription
from stiffmap.model.description.tree import sequences
from stiffmap.model.effects import Parameter, registry

VISIBLE = 3.0
"""Noise: a candidate whose largest plausible size shows less is left out."""
LARGEST = 20.0
"""Noise, rms: two places are one where even an effect of this size would differ by less than `VISIBLE`."""
AT_ONCE = 256
"""Variants whose columns are taken together."""
NULL = 1e-9
"""Share of the longest column below which a direction is no direction."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One candidate at one shape: its directions U (m, p), orthonormal over the noise."""

    variant: Variant
    directions: Floats
    sign: int
    """+1 or -1 where a single strength can only have that sign along the direction, else 0."""

    @property
    def factor(self) -> Floats:
        """(m, p) F of the covariance F Fᵀ of an effect of rms one in the noise."""
        m, p = self.directions.shape
        return np.asarray(self.directions * np.sqrt(m / p))


@dataclass(frozen=True, eq=False)
class Place:
    """A candidate that the plan separates from all others, at all its shapes; the others are its aliases."""

    candidate: Candidate
    shapes: tuple[Shape, ...]
    aliases: tuple[Candidate, ...] = ()
    wider: tuple[Candidate, ...] = ()
    """Candidates of more directions that contain its own."""

    @cached_property
    def span(self) -> tuple[Floats, Floats]:
        """(m, r) orthonormal directions that span all shapes, far fewer than those of many waves; and (r, shapes p) the factors of all
        shapes `side_by_side` along them."""
        factors = side_by_side(self.shapes)
        some = whole = factors.reshape(len(factors), -1)
        if whole.shape[1] > len(whole):
            # as many sums of them as can be apart, drawn at random, span the same
            some = whole @ np.random.default_rng(0).normal(size=whole.shape[::-1])
        u, r, _ = qr(some, mode="economic", pivoting=True)
        size = np.abs(np.diag(r))
        span = u[:, size > NULL * size[0]]
        return span, span.T @ whole


def side_by_side(shapes: Sequence[Shape]) -> Floats:
    """(m, shapes, p) factors, with columns of zeros where a shape has fewer than p."""
    factors = np.zeros((len(shapes[0].directions), len(shapes), max(s.directions.shape[1] for s in shapes)))
    for k, s in enumerate(shapes):
        factors[:, k, : s.directions.shape[1]] = s.factor
    return factors


def of_every_two(columns: Floats, rank: int, both: Integers) -> Floats:
    """(pairs, 2 p, 2 p) inner products of columns (m, shapes p), those of two shapes of p = `rank` columns each; `both` (pairs, 2)."""
    gram = (columns.T @ columns).reshape(-1, rank, columns.shape[1] // rank, rank).swapaxes(1, 2)
    return np.asarray(gram[both[:, :, None], both[:, None, :]].swapaxes(2, 3).reshape(-1, 2 * rank, 2 * rank))


def places(
    plan: CandidatePlan, free: Floats, noise: Floats, use: Integers, description: MachineDescription
) -> tuple[Place, ...]:
    """Candidates with their directions; those that show alike under one name, that of the coarsest part."""
    by: dict[int, list[Shape]] = {}
    for begin in range(0, len(plan.variants), AT_ONCE):
        some = plan.variants[begin : begin + AT_ONCE]
        lines = [v.lines(use) / noise for v in some]
        ends = np.cumsum([len(k) for k in lines])[:-1]
        for v, white in zip(some, np.split(free.T @ np.concatenate(lines).T, ends, axis=1), strict=True):
            found = shape_of(v, white)
            if found is not None:
                by.setdefault(id(v.candidate), []).append(found)
    tolerance = VISIBLE / (LARGEST * np.sqrt(free.shape[1]))

    def order(shapes: list[Shape]) -> tuple[object, ...]:
        rank = shapes[0].directions.shape[1]
        return (rank, len(shapes) > 1, *coarseness(shapes[0].variant.candidate, rank, description))

    out: list[Place] = []
    single: list[tuple[Floats, int, int]] = []
    for shapes in sorted(by.values(), key=order):
        candidate, first = shapes[0].variant.candidate, shapes[0]
        if len(shapes) == 1:
            same = next((k for d, sign, k in single if _alike(d, sign, first, tolerance)), None)
            if same is not None:
                out[same] = replace(out[same], aliases=(*out[same].aliases, candidate))
                continue
            single.append((first.directions, first.sign, len(out)))
        out.append(Place(candidate, tuple(shapes)))
    for d, _, k in single:
        wider = tuple(
            out[j].candidate
            for other, _, j in single
            if other.shape[1] > d.shape[1] and d.shape[1] - np.sum((other.T @ d) ** 2) < tolerance**2
        )
        out[k] = replace(out[k], wider=wider)
    return tuple(out)


def shape_of(v: Variant, white: Floats) -> Shape | None:
    """A variant by its columns (m, q) in noise: those that a plausible size makes visible; None without any."""
    length = np.linalg.norm(white, axis=0)
    linear = v.candidate.linear
    limits = [reach(p) for p in linear] if len(linear) == len(v.sign) else []  # largest plausible values
    most = np.minimum([*limits, *[np.inf] * (white.shape[1] - len(limits))], min(v.most, 1.0 / NULL))
    seen = length * most > VISIBLE
    if not seen.any():
        return None
    u, s, _ = np.linalg.svd(white[:, seen] / length[seen], full_matrices=False)
    kept = u[:, s > 1e-4 * s[0]]
    sign = 0
    if kept.shape[1] == 1 and seen.sum() == 1 and v.sign[seen][0]:
        sign = int(np.sign(v.sign[seen][0]) * np.sign(float(kept[:, 0] @ white[:, seen][:, 0])))
    return Shape(v, np.asfortranarray(kept), sign)


def reach(p: Parameter) -> float:
    """Largest change from its null that a parameter can have, in its scale."""
    low, high = possible(p)
    null = float(p.null or 0.0)
    return max(high - null, null - low) / p.scale


def possible(p: Parameter) -> tuple[float, float]:
    """Least and largest value of a parameter (SI) that a machine can have."""
    if p.plausible:
        return p.plausible
    null = float(p.null or 0.0)
    # a width or an amplitude is no error
    most = np.inf if p.lower == null else LARGEST_ERROR.get(p.unit, np.inf)
    return max(p.lower, null - most), min(p.upper, null + most)


def _alike(directions: Floats, sign: int, other: Shape, tolerance: float) -> bool:
    if directions.shape != other.directions.shape:
        return False
    across = directions.T @ other.directions
    if sign and other.sign and float(across[0, 0]) * sign * other.sign < 0.0:
        return False
    return bool(np.sum(other.directions**2) - np.sum(across**2) < tolerance**2)


def coarseness(
    candidate: Candidate, rank: int, description: MachineDescription
) -> tuple[int, bool, int, int]:
    """Sort key: fewest directions, constant before what a reversal of load would show, then drive, whole
    link or body, joint, offset, single entry; then kind."""
    kind = candidate.kind
    part = _part(candidate.element, description)
    return (rank, registry.get(kind).reverses, part, registry.kinds().index(kind))


def _part(element: str, description: MachineDescription) -> int:
    if "." in element:
        return 4
    found = [e for g in description.legs for _, s in sequences(g.elements) for e in s if e.name == element]
    if any(isinstance(e, Joint) and e.actuated for e in found):
        return 0
    kinds = {type(e).__name__ for e in found}
    return 1 if "Spring" in kinds or not found else 2 if "Joint" in kinds else 3

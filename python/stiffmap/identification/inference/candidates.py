"""All candidates at once at given amplitudes: what each would add to the evidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.amplitudes import Fit, gains, log_mean
from stiffmap.identification.inference.constants import SIZES
from stiffmap.identification.inference.places import Place, Shape

PAIR_STRIDE = 3
"""Of the sizes that pairs are tried with: every third; effort only."""
AT_ONCE = 512
"""Directions that are solved for together."""


def evidence(fit: Fit, places: tuple[Place, ...]) -> list[Floats]:
    """Per place, (shapes,) mean over sizes of the gain of evidence of an effect there, ln."""
    shapes = [s for p in places for s in p.shapes]
    out = np.empty(len(shapes))
    by_rank: dict[int, list[int]] = {}
    for k, s in enumerate(shapes):
        by_rank.setdefault(s.directions.shape[1], []).append(k)
    for rank, members in by_rank.items():
        for begin in range(0, len(members), max(1, AT_ONCE // rank)):
            some = members[begin : begin + max(1, AT_ONCE // rank)]
            out[some] = _of_rank(fit, [shapes[k] for k in some], rank)
    ends = np.cumsum([len(p.shapes) for p in places])
    return [out[end - len(p.shapes) : end] for p, end in zip(places, ends, strict=True)]


def _of_rank(fit: Fit, shapes: list[Shape], rank: int) -> Floats:
    m = len(fit.columns)
    factor = np.hstack([s.factor for s in shapes])
    white = fit.white(factor).reshape(m, len(shapes), rank)
    inside, vectors = np.linalg.eigh(np.einsum("mia,mib->iab", white, white))
    z = np.einsum("iab,ia->ib", vectors, (factor.T @ fit.solved).reshape(len(shapes), rank))
    gain = gains(inside, z)
    if rank == 1:
        sign = np.array([s.sign for s in shapes])[:, None]
        straight = (vectors[:, 0, 0] * z[:, 0])[:, None]
        side = norm.logcdf(sign * straight * SIZES / np.sqrt(1.0 + inside * SIZES**2)) + np.log(2.0)
        gain = gain + np.where(sign == 0, 0.0, side)
    return log_mean(gain)


def of_pairs(fit: Fit, shapes: Sequence[Shape]) -> Floats:
    """(s, s) gain of evidence by every two of some shapes together, mean over both sizes; nothing of one with itself."""
    m, s = len(fit.columns), len(shapes)
    rank = max(v.directions.shape[1] for v in shapes)
    factor = np.zeros((m, s, rank))
    for k, v in enumerate(shapes):
        factor[:, k, : v.directions.shape[1]] = v.factor
    white = fit.white(factor.reshape(m, -1))
    gram = (white.T @ white).reshape(s, rank, s, rank)
    z = (factor.reshape(m, -1).T @ fit.solved).reshape(s, rank)
    b2 = SIZES[::PAIR_STRIDE] ** 2
    squares = np.stack(np.meshgrid(b2, b2, indexing="ij"), axis=-1).reshape(-1, 2).repeat(rank, axis=1)
    out = np.full((s, s), -np.inf)
    for i in range(s):
        for j in range(i):
            both = [i, j]
            g = gram[both][:, :, both].reshape(2 * rank, 2 * rank)
            zz = z[both].reshape(-1)
            root = np.sqrt(squares)
            inner = np.eye(2 * rank) + root[:, :, None] * g * root[:, None, :]
            scaled = root * zz
            solved = np.linalg.solve(inner, scaled[..., None])[..., 0]
            gain = 0.5 * np.sum(scaled * solved, axis=1) - 0.5 * np.linalg.slogdet(inner)[1]
            out[i, j] = out[j, i] = log_mean(gain)
    return out

"""All candidates at once at given amplitudes: what each would add to the evidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dtrtri
from scipy.stats import norm

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.constants import SIZES
from stiffmap.identification.inference.parts import gains, log_mean
from stiffmap.identification.inference.places import Place, Shape

PAIR_STRIDE = 3
"""Of the sizes that pairs are tried with: every third; effort only."""
AT_ONCE = 512
"""Directions that are solved for together."""


def evidence(fit: Fit, places: tuple[Place, ...]) -> list[Floats]:
    """Per place, (shapes,) mean over sizes of the gain of evidence of an effect there, ln; worked out once for each fit."""
    by_rank: dict[int, list[tuple[Floats, int, Shape]]] = {}
    for p in places:
        if id(p) not in fit.gain:
            fit.gain[id(p)] = np.empty(len(p.shapes))
            for k, s in enumerate(p.shapes):
                by_rank.setdefault(s.directions.shape[1], []).append((fit.gain[id(p)], k, s))
    asked = sum(rank * len(members) for rank, members in by_rank.items())
    # of the factor: products with it take half the time, and pay where many are asked for
    inverse = dtrtri(fit.root, lower=1)[0] if asked > len(fit.columns) else None
    for rank, members in by_rank.items():
        for begin in range(0, len(members), max(1, AT_ONCE // rank)):
            some = members[begin : begin + max(1, AT_ONCE // rank)]
            for (to, k, _), gain in zip(
                some, _of_rank(fit, [s for _, _, s in some], rank, inverse), strict=True
            ):
                to[k] = gain
    return [fit.gain[id(p)] for p in places]


def _of_rank(fit: Fit, shapes: list[Shape], rank: int, inverse: Floats | None = None) -> Floats:
    directions = np.concatenate([s.directions.T for s in shapes]).T
    scale = len(fit.columns) / rank  # of a factor's square over that of the directions
    white = fit.white(directions) if inverse is None else dtrmm(1.0, inverse, directions, lower=1)
    white = white.T.reshape(len(shapes), rank, -1)
    inside, vectors = np.linalg.eigh(scale * (white @ white.transpose(0, 2, 1)))
    along = np.sqrt(scale) * (directions.T @ fit.solved).reshape(len(shapes), rank)
    z = np.einsum("iab,ia->ib", vectors, along)
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
    gram = (white.T @ white).reshape(s, rank, s, rank).swapaxes(1, 2)
    z = (factor.reshape(m, -1).T @ fit.solved).reshape(s, rank)
    b2 = SIZES[::PAIR_STRIDE] ** 2
    root = np.sqrt(np.stack(np.meshgrid(b2, b2, indexing="ij"), axis=-1).reshape(-1, 2).repeat(rank, axis=1))
    first, second = np.tril_indices(s, -1)
    both = np.stack([first, second], axis=1)
    of_two = gram[both[:, :, None], both[:, None, :]].swapaxes(2, 3).reshape(-1, 1, 2 * rank, 2 * rank)
    inner = np.eye(2 * rank) + root[:, :, None] * of_two * root[:, None, :]
    scaled = root * z[both].reshape(-1, 1, 2 * rank)
    solved = np.linalg.solve(inner, scaled[..., None])[..., 0]
    out = np.full((s, s), -np.inf)
    out[first, second] = log_mean(0.5 * np.sum(scaled * solved, axis=-1) - 0.5 * np.linalg.slogdet(inner)[1])
    return np.asarray(np.maximum(out, out.T))

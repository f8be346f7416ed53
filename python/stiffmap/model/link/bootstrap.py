"""Block bootstrap of the compliance over patches of nodes: no model of the correlation needed."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import random_numbers
from stiffmap.model.link.arrays import Bools, Floats, Ints
from stiffmap.model.link.rigidfit import design_matrix


def node_patches(points: Floats, patches: int) -> Ints:
    """(n,) patch number of each node: halves along the longest side until there are ``patches``.

    The number is rounded down to a power of two. It does not depend on the numbering of the nodes.
    """
    order = np.lexsort(points.T)
    groups = [order]
    while 2 * len(groups) <= patches:
        groups = [half for g in groups for half in _halves(points, g)]
    label = np.empty(len(points), dtype=np.int64)
    for number, group in enumerate(groups):
        label[group] = number
    return label


def block_bootstrap(
    points: Floats,
    displacements: Floats,
    gain: Floats,
    reference: Floats,
    kept: Bools,
    patches: int = 32,
    samples: int = 500,
    seed: int = 0,
) -> Floats:
    """(36, 36) covariance of the compliance entries from resampled patches of nodes.

    The same patches are drawn for every load case, so correlation between cases is kept. Patches must
    be larger than the correlation length and at least about twenty for the estimate to be good to 20 %.

    Args:
        points: (n, 3) m; displacements: (cases, n, 3) m; reference: (3,) m.
        gain: (cases, 36, 6) from twists to entries; kept: (cases, n) nodes in the fit.
        patches, samples, seed: size of the bootstrap.
    """
    label = node_patches(points, min(patches, len(points) // 3))
    count = int(label.max()) + 1
    A = design_matrix(points, reference)
    scale = np.array([1.0] * 3 + [1 / max(float(np.abs(A[:, :, 3:]).max()), 1e-300)] * 3)
    A = A * scale
    normal = np.zeros((count, len(displacements), 6, 6))
    right = np.zeros((count, len(displacements), 6))
    np.add.at(normal, label, np.einsum("kn,nia,nib->nkab", kept.astype(float), A, A))
    np.add.at(right, label, np.einsum("kn,nia,kni->nka", kept.astype(float), A, displacements))
    rng = random_numbers(seed)
    times = rng.multinomial(count, np.full(count, 1 / count), size=samples).astype(float)
    M, b = np.einsum("sp,pkab->skab", times, normal), np.einsum("sp,pka->ska", times, right)
    solvable = np.linalg.cond(M).max(axis=1) < 1e8
    twists = np.linalg.solve(M[solvable], b[solvable][..., None])[..., 0] * scale
    entries = np.einsum("kea,ska->se", gain, twists)
    return np.asarray(np.cov(entries.T))


def _halves(points: Floats, group: Ints) -> tuple[Ints, Ints]:
    axis = int(np.argmax(np.ptp(points[group], axis=0)))
    ranked = group[np.argsort(points[group, axis], kind="stable")]
    return ranked[: len(ranked) // 2], ranked[len(ranked) // 2 :]

"""What an effect adds to the evidence, the mean over its sizes."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.inference.constants import SIZES


def of_size(factor: Floats, root: Floats, solved: Floats, t: float) -> float:
    """ln of the mean over sizes of an effect with a factor (m, p), of the likelihood relative to that at its ln variance t in the model."""
    inside, z = spectrum(root, solved, factor)
    # without the effect (Woodbury): 1/λ grows by the variance that the model gives it
    b2 = np.exp(t)
    share = np.maximum(1.0 - b2 * inside, 1e-12)
    return float(
        log_mean(gains(inside / share, z / share)) - gains(inside / share, z / share, np.array([b2]))[0]
    )


def spectrum(root: Floats, solved: Floats, factor: Floats) -> tuple[Floats, Floats]:
    """(p,) information of a covariance about the directions of a factor (m, p), and (p,) what the readings say along them."""
    white = solve_triangular(root, factor, lower=True, check_finite=False)
    inside, vectors = np.linalg.eigh(white.T @ white)
    return inside, np.asarray(vectors.T @ (factor.T @ solved))


def gains(inside: Floats, z: Floats, squared: Floats = SIZES**2) -> Floats:
    """(..., B) gain of ln likelihood by an effect of size b along directions (..., p) of information `inside`."""
    a, s = inside[..., None], z[..., None] ** 2
    return np.asarray((0.5 * s * squared / (1.0 + a * squared) - 0.5 * np.log1p(a * squared)).sum(axis=-2))


def log_mean(values: Floats) -> Floats:
    """ln of the mean of exponentials over the last axis."""
    top = values.max(axis=-1, keepdims=True)
    return np.asarray(top[..., 0] + np.log(np.mean(np.exp(values - top), axis=-1)))

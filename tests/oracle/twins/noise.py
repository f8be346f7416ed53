"""Noise as instruments have it, in units of the declared standard deviation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Noise = Callable[[np.random.Generator, int, int], np.ndarray]


def gaussian(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """As declared."""
    return rng.standard_normal((n, c))


def half(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """Twice as large as declared."""
    return 2.0 * rng.standard_normal((n, c))


def double(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """Half as large as declared."""
    return 0.5 * rng.standard_normal((n, c))


def correlated(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """Along time, AR(1) with 0.7, and half shared between the axes."""
    out = np.zeros((n, c))
    both = rng.standard_normal((n, 1)) * np.sqrt(0.5) + rng.standard_normal((n, c)) * np.sqrt(0.5)
    out[0] = both[0]
    for i in range(1, n):
        out[i] = 0.7 * out[i - 1] + np.sqrt(1.0 - 0.49) * both[i]
    return out


def heavy(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """Student's t with three degrees of freedom, of unit variance."""
    return rng.standard_t(3, (n, c)) / np.sqrt(3.0)


def outliers(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """3 % of the rows 10 to 30 standard deviations off."""
    out = rng.standard_normal((n, c))
    gross = rng.choice(n, max(2, round(0.03 * n)), replace=False)
    out[gross] += rng.choice((-1.0, 1.0), (len(gross), c)) * rng.uniform(10.0, 30.0, (len(gross), 1))
    return out


def creep(rng: np.random.Generator, n: int, c: int) -> np.ndarray:
    """A set-up that settles: 4 standard deviations along one way, gone after a third of the session."""
    way = rng.standard_normal(c)
    way *= 4.0 / np.linalg.norm(way)
    return rng.standard_normal((n, c)) + np.exp(-np.arange(n) / (n / 6.0))[:, None] * way


KINDS: dict[str, Noise] = {
    f.__name__: f for f in (gaussian, half, double, correlated, heavy, outliers, creep)
}

"""Sums of values times waves at equally spaced frequencies: values are spread onto an even grid, which a fast transform takes.

The non-uniform transform of type 1 with the kernel exp(β(√(1 - z²) - 1)) of A. H. Barnett, J. Magland and L. af Klinteberg
(SIAM J. Sci. Comput. 41, C479, 2019); what it misses is round-off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, next_fast_len
from scipy.sparse import csr_array

from stiffmap.common.broadcasting import Floats

Complex = NDArray[np.complex128]
WIDTH = 14
"""Grid points over which a value is spread; twice as many points as frequencies."""
BETA = 2.3 * WIDTH


class Fourier:
    """Σ_n v_n exp(2πi f_k u_n) for f_k = first + k step, k = 0 … count - 1."""

    def __init__(self, places: Floats, first: float, step: float, count: int) -> None:
        """`places` (n,): u."""
        self._count, self._half = count, count // 2
        self._size = int(next_fast_len(max(2 * count, 2 * WIDTH)))
        self._phase = np.exp(2j * np.pi * (first + self._half * step) * places)
        self._spread = _spread(2 * np.pi * step * places, self._size)
        modes = np.arange(count) - self._half
        self._at = modes % self._size
        self._shape = self._size / (0.5 * WIDTH * _transform(modes * np.pi * WIDTH / self._size))

    def __call__(self, values: Floats) -> Complex:
        """(count, S) of (n, S) values."""
        grid = self._spread @ (self._phase[:, None] * values)
        return np.asarray(ifft(grid, axis=0)[self._at] * self._shape[:, None])


def _spread(angle: Floats, size: int) -> Any:
    """(size, n) what each of n angles gives to the points of a periodic grid."""
    at = np.mod(angle, 2 * np.pi) * size / (2 * np.pi)
    first = np.ceil(at - WIDTH / 2)
    points = first[:, None] + np.arange(WIDTH)
    z = np.clip((points - at[:, None]) / (WIDTH / 2), -1.0, 1.0)
    given = np.exp(BETA * (np.sqrt(1.0 - z**2) - 1.0))
    columns = np.repeat(np.arange(len(angle)), WIDTH)
    rows = np.mod(points, size).astype(np.intp).ravel()
    return csr_array((given.ravel(), (rows, columns)), shape=(size, len(angle)))


def _transform(frequency: Floats) -> Floats:
    """∫ kernel(z) exp(i frequency z) dz over [-1, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    kernel = weights * np.exp(BETA * (np.sqrt(1.0 - nodes**2) - 1.0))
    return np.asarray(np.cos(np.multiply.outer(frequency, nodes)) @ kernel)

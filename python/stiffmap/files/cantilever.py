"""Compliance of an Euler-Bernoulli cantilever at its free end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def cantilever_compliance(
    length: float, along: str, ea: float, gj: float, ei_next: float, ei_last: float
) -> NDArray[np.float64]:
    """Compliance (6, 6) at the far end, local axes, SI.

    The beam leaves its root along ``along`` (x, y, z, -x, -y, -z). ``ei_next`` is the bending
    stiffness about the axis that follows cyclically (y of x, z of y, x of z), ``ei_last`` about
    the remaining one.
    """
    sign = -1.0 if along.startswith("-") else 1.0
    a = "xyz".index(along[-1])
    b, c = (a + 1) % 3, (a + 2) % 3
    k = np.zeros((6, 6))
    k[a, a], k[3 + a, 3 + a] = length / ea, length / gj
    k[b, b], k[3 + c, 3 + c] = length**3 / (3 * ei_last), length / ei_last
    k[c, c], k[3 + b, 3 + b] = length**3 / (3 * ei_next), length / ei_next
    k[b, 3 + c] = k[3 + c, b] = sign * length**2 / (2 * ei_last)
    k[c, 3 + b] = k[3 + b, c] = -sign * length**2 / (2 * ei_next)
    return k

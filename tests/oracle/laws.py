"""Forces of laws and errors of commands at many deflections, straight from the description."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.model.description import Joint

Array = np.ndarray


def command_error(c: Any, u: Array, e: Joint) -> Array:
    """Added to the command u."""
    assert not c.of, "errors of another joint's coordinate are judged in Cartesian coordinates"
    v = u - (e.home[0] if c.reference is None else c.reference)
    out: Array = c.offset + c.slope * v + c.amplitude * np.sin(2 * np.pi * v / c.period + c.phase)
    return out + np.interp(u, *np.transpose(c.knots)) if c.knots else out


def law_force(law: Any, a: Array, soft: Array, rubs: Array) -> tuple[Array, tuple[Array, Array] | None]:
    """Force of a law at deflections a (n,), the compliance being `soft` times as large; what it allows if it is
    not one number."""
    if law.knots:
        low, high = polyline(law, a, soft)
        return (low + high) / 2, (low[:, None], high[:, None])
    force: Array = law.stiffness * a / soft + law.cubic * a**3
    if law.friction:
        both = force[:, None] + rubs
        known = rubs.min(1) == rubs.max(1)
        return np.where(known, both[:, 0], 0.0), (both, both)  # what is second order is small
    return force, None


def polyline(law: Any, a: Array, soft: Array) -> tuple[Array, Array]:
    """Least and largest force at a deflection within round-off of a."""
    k = np.array(law.knots)
    reach = 1e-12 + 1e-9 * np.abs(k[:, 0]).max()
    out = []
    for side in (-reach, reach):
        v = a + side
        force = np.interp(v, k[:, 0], k[:, 1])
        force = np.where(v < k[0, 0], k[0, 1] + law.stiffness / soft * (v - k[0, 0]), force)
        out.append(np.where(v > k[-1, 0], k[-1, 1] + law.stiffness / soft * (v - k[-1, 0]), force))
    return out[0], out[1]

"""Bounded least squares of a few numbers: damped, and nothing moves along directions that the readings do not determine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError

RANK, LEAST, FELT = 1e-8, 1e-3, 1e-6
"""Singular values of the columns, relative to the largest and in noise per typical size, below which a direction is not determined; the
share of a number in such directions from which on it is not."""
Residual = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where the squares of residuals (N,) are least, numbers (k,) in typical sizes."""

    x: Floats
    residual: Floats
    """(N,)."""
    jacobian: Floats
    """(N, k) change of the residuals per typical size of each number."""

    @property
    def chi2(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


def optimum(
    residual: Residual, begin: Floats, bounds: tuple[Floats, Floats], slopes: Residual, steps: int
) -> Optimum:
    """The optimum near `begin` (k,), within the bounds.

    residual
        (k,) -> (N,) in noise; StiffmapError where the machine cannot be, which no step leads to.
    slopes
        (k,) -> (N, k) changes of the residual per typical size.
    steps
        Evaluations at most.

    Raises StiffmapError where the machine cannot be at `begin`.
    """
    low, high = bounds
    inside = 1e-9 * np.minimum(high - low, 1.0)
    x = np.clip(begin, low + inside, high - inside)
    here = residual(x)
    if not len(x):
        return Optimum(x, here, np.zeros((len(here), 0)))
    last: list[Floats] = []

    def held(x: Floats) -> Floats:
        last[:] = [slopes(x)]
        return _held(last[0])

    found = least_squares(
        lambda x: np.append(possible(residual, x, len(here)), np.zeros(len(x))),
        x,
        held,
        bounds,
        max_nfev=steps,
    )
    return Optimum(found.x, found.fun[: len(here)], last[0])


def remembered(function: Residual) -> Residual:
    """The function with its last value kept, since a search asks again where it stands."""
    last: dict[bytes, Floats] = {}

    def value(x: Floats) -> Floats:
        key = x.tobytes()
        if key not in last:
            found = function(x)
            last.clear()
            last[key] = found
        return last[key]

    return value


def triangular(
    moving: Residual, held: Floats, begin: Floats, bounds: tuple[Floats, Floats], **ends: float
) -> Floats:
    """(n,) the least squares near `begin`, within the bounds: the triangle of the columns and the residual has the same squares and the
    same steps in next to n rows. Numbers are in typical sizes: scaled by their columns, those that hardly show would move furthest.

    moving
        (n,) -> (N, n - h + 1) columns of the first numbers, and the residual; infinite where no step leads to.
    held
        (N, h) columns of the last numbers, wherever the search stands; of full rank.
    """
    h, first = held.shape[1], len(begin) - held.shape[1]
    q, above = np.linalg.qr(held)

    @remembered
    def triangle(x: Floats) -> Floats:
        rows = moving(x)
        if not np.isfinite(rows).all():
            return np.full((2 * first + h + 1, first + h + 1), np.inf)
        along = q.T @ rows
        own = np.zeros((first + 1, first + 1))
        own[: len(rows)] = np.linalg.qr(rows - q @ along, mode="r")
        below, last = _held(own[:, :first]), np.append(own[:, first], np.zeros(first))
        return np.block(
            [[along[:, :first], above, along[:, first:]], [below, np.zeros((len(below), h)), last[:, None]]]
        )

    def residual(x: Floats) -> Floats:
        return triangle(x)[:, -1]

    def columns(x: Floats) -> Floats:
        return triangle(x)[:, :-1]

    return np.asarray(least_squares(residual, begin, columns, bounds, **ends).x)


def possible(residual: Residual, x: Floats, n: int) -> Floats:
    """(n,) residuals; infinite where the machine cannot be."""
    try:
        return residual(x)
    except StiffmapError:
        return np.full(n, np.inf)


def differences(residual: Residual, x: Floats, step: float) -> Floats:
    """(N, k) changes of residuals at x (k,) by one step each; backwards where the machine cannot be ahead, zero where it can be on
    neither side."""
    here = residual(x)
    out = np.zeros((len(here), len(x)))
    for j, unit in enumerate(np.eye(len(x))):
        for h in (step, -step):
            change = (possible(residual, x + h * unit, len(here)) - here) / h
            if np.isfinite(change).all():
                out[:, j] = change
                break
    return out


def covariance(jacobian: Floats) -> tuple[Floats, int]:
    """(k, k) of numbers with columns (N, k) in noise per typical size, infinite variances of those that the readings do not
    determine; the rank."""
    size, v, lost = _directions(jacobian)
    out: Floats = (v.T / size**2) @ v
    untold = np.flatnonzero(np.linalg.norm(lost, axis=0) > FELT)
    out[untold, untold] = np.inf
    return out, len(size)


def _directions(jacobian: Floats) -> tuple[Floats, Floats, Floats]:
    """(r,) singular values of columns (N, k), and (r, k) their directions, as far as determined; (k - r, k) the other directions."""
    # of as many rows as columns, quicker than all of them
    triangle = np.asarray(np.linalg.qr(jacobian, mode="r"))
    _, size, v = np.linalg.svd(triangle, full_matrices=len(triangle) < triangle.shape[1])
    size = np.append(size, np.zeros(len(v) - len(size)))
    told = size > max(RANK * size.max(initial=0.0), LEAST)
    return size[told], v[told], v[~told]


def _held(jacobian: Floats) -> Floats:
    """(N + k, k) the columns without the directions that the readings do not determine, which rows of their own hold where they are."""
    size, _, lost = _directions(jacobian)
    away = lost.T @ lost
    return np.vstack([jacobian - jacobian @ away, size.max(initial=1.0) * away])

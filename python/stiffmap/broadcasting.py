"""Inputs of array calls: shapes checked by name, broadcast together."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.errors import StiffmapError

Floats = NDArray[np.float64]


def trailing(values: ArrayLike, shape: tuple[int, ...], name: str, what: str) -> Floats:
    """Float array whose last axes have `shape`; StiffmapError otherwise."""
    try:
        out = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError) as problem:
        raise StiffmapError(f"{name}: expected {what}, got {type(values).__name__} ({problem})") from None
    n = len(shape)
    if out.ndim < n or out.shape[out.ndim - n :] != shape:
        wanted = ", ".join(str(s) for s in shape)
        raise StiffmapError(f"{name}: expected {what} of shape (..., {wanted}), got shape {out.shape}")
    return out


def wrench_array(values: ArrayLike | None, name: str = "wrench") -> Floats:
    """(..., 6); a bare force is refused, since its moment must be said."""
    if values is None:
        return np.zeros(6)
    if np.ndim(values) and np.shape(values)[-1] == 3:
        raise StiffmapError(
            f"{name}: expected 6 numbers [fx fy fz mx my mz] (N, N·m), got 3; append the moment, "
            "for a pure force [fx, fy, fz, 0, 0, 0]"
        )
    out = trailing(values, (6,), name, "wrenches [fx fy fz mx my mz] (N, N·m)")
    if not np.isfinite(out).all():
        raise StiffmapError(f"{name}: expected finite numbers, got {np.sum(~np.isfinite(out))} that are not")
    return out


def batch(*shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Common batch shape; StiffmapError where they do not broadcast."""
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise StiffmapError(f"batch axes do not broadcast together: {', '.join(map(str, shapes))}") from None


def rows(values: Floats, shape: tuple[int, ...], tail: tuple[int, ...]) -> Floats:
    """C-contiguous copy of shape (batch size, *tail)."""
    return np.ascontiguousarray(np.broadcast_to(values, shape + tail)).reshape((-1,) + tail)


def rows_or_one(values: Floats, shape: tuple[int, ...], tail: tuple[int, ...]) -> Floats:
    """C-contiguous copy of shape (batch size, *tail), or (1, *tail) where one is meant for all."""
    return rows(values, () if values.ndim == len(tail) else shape, tail)


def thread_count(threads: int | None) -> int:
    """Number of threads: all that this process may use unless said otherwise."""
    if threads is None:
        affinity = getattr(os, "sched_getaffinity", None)
        return len(affinity(0)) if affinity else os.cpu_count() or 1
    if threads < 1:
        raise StiffmapError(f"threads: expected 1 or more, got {threads}")
    return int(threads)

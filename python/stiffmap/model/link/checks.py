"""The door of the identification: every input is checked once, here, and trusted inside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, Mask, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import SMALLEST

AXES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
COLLINEAR = 1e-6  # second singular value of the centred nodes over the first
RANK = 1e-9  # singular value of the column-scaled wrenches over the largest


class DisplacementField(NamedTuple):
    """Displacement field of a set of load cases: SI units, link axes."""

    points: Floats  # (n, 3) m
    displacements: Floats  # (cases, n, 3) m
    wrenches: Floats  # (cases, 6) N, N·m at the reference point
    reference: Floats  # (3,) m


def checked_field(
    points: ArrayLike, displacements: ArrayLike, wrenches: ArrayLike, reference: ArrayLike
) -> DisplacementField:
    """The four arrays as float64 after all checks of shape, finiteness and geometry.

    Raises:
        StiffmapError: wrong shape, NaN or infinity, fewer than three points, collinear points, a reference in another unit.
    """
    p = finite_array("points", points, (None, 3), "(n, 3) in m")
    check_points(p)
    w = finite_array("wrenches", wrenches, (None, 6), "(cases, 6) in N and N·m")
    u = finite_array("displacements", displacements, (len(w), len(p), 3), "(cases, n, 3) in m")
    if np.abs(u).max(initial=0.0) < SMALLEST:
        raise StiffmapError(
            "displacements: expected a field that moves, got 0 m at every point of every case"
        )
    r = finite_array("reference", reference, (3,), "(3,) in m")
    size = float(np.linalg.norm(np.ptp(p, axis=0)))
    far, other = (float(np.linalg.norm(v - v.clip(p.min(axis=0), p.max(axis=0)))) for v in (r, 1e3 * r))
    if far > size and other < size / 2:
        found = f"one {far:.3g} m off, which times 1000 is among them: is it in m where mm are meant?"
        raise StiffmapError(f"reference: expected a place near the points, {size:.3g} m wide; found {found}")
    return DisplacementField(p, u, w, r)


def check_points(points: Floats) -> None:
    """Refuse nodes that cannot show a rotation: fewer than three, or all on one line.

    Raises:
        StiffmapError: with the number of points, or with their spread along and across the line.
    """
    if len(points) < 3:
        raise StiffmapError(f"points: expected at least 3 to fit a rigid-body motion, got {len(points)}")
    if on_one_line(points):
        s = spread(points)
        raise StiffmapError(
            "points: expected points that are not on one line (the turn about it cannot be seen), "
            f"got a spread of {s[0]:.3g} m along and {s[1]:.1g} m across"
        )


def on_one_line(points: Floats) -> bool:
    """Whether points (n, 3) m, three or more, show no turn about a line on which they all lie."""
    s = spread(points)
    return bool(s[1] <= COLLINEAR * s[0])


def spread(points: Floats) -> Floats:
    """(3,) m: root of the sum of squares of points (n, 3) about their centre, along their three main axes."""
    return np.asarray(np.linalg.svd(points - points.mean(axis=0), compute_uv=False))


def identifiable_columns(wrenches: Floats, *, partial: bool) -> Mask:
    """Which of the six columns of the compliance the wrenches (cases, 6) determine, as (6,) bool.

    Column j is determined when the unit wrench j is in the row space of the cases.

    Raises:
        StiffmapError: rank below six without ``partial``; names what cannot be identified.
    """
    scale = np.linalg.norm(wrenches, axis=0)
    _, s, vt = np.linalg.svd(wrenches / np.where(scale > 0, scale, 1.0))
    rank = int(np.sum(s > RANK * s.max(initial=0.0)))
    null = vt[rank:]
    seen: Mask = (np.linalg.norm(null, axis=0) < 1e-6) & (scale > 0)
    if rank < 6 and not partial:
        missing = ", ".join(a for a, ok in zip(AXES, seen, strict=True) if not ok)
        raise StiffmapError(
            f"wrenches: expected load cases of rank 6, got rank {rank} from {len(wrenches)} cases; "
            f"the columns of {missing} cannot be identified (partial=True leaves NaN for them)"
        )
    if rank == 0:
        raise StiffmapError("wrenches: expected at least one load case that is not zero")
    return seen


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...], words: str) -> Floats:
    """Finite numbers of a shape, None where any size will do; StiffmapError for anything else."""
    a = real_array(value, name, f"an array of numbers, {words}")
    fits = a.ndim == len(shape) and all(
        want is None or want == got for want, got in zip(shape, a.shape, strict=True)
    )
    if not fits:
        wanted = "(" + ", ".join("any" if s is None else str(s) for s in shape) + ")"
        raise StiffmapError(f"{name}: expected shape {words}, here {wanted}, got {a.shape}")
    if not np.all(np.isfinite(a)):
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(a))[0])
        count = int((~np.isfinite(a)).sum())
        raise StiffmapError(f"{name}: expected finite numbers, got {count} NaN or infinite, first at {first}")
    return a

"""Springs that vary with a joint's coordinate: rams, cross-beams, columns on which a head travels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.units import Dimension

Matrix6 = tuple[tuple[float, ...], ...]


def as_rows(matrix: ArrayLike) -> Matrix6:
    """A matrix (6, 6) as hashable rows."""
    return tuple(tuple(float(v) for v in row) for row in np.asarray(matrix, dtype=float))


def entry_dimension(word: str, i: int, j: int) -> Dimension:
    """Unit of the entry (i, j), counted from 0, of a spring's ``compliance`` or ``stiffness``."""
    turns, sign = (i > 2) + (j > 2), 1 if word == "compliance" else -1
    return Dimension(length=sign * (1 - turns), force=-sign, angle=sign * min(turns, 1))


@dataclass(frozen=True)
class BeamStroke:
    """A beam that is ``length`` (m) long where joint ``joint`` is at ``at``, and ``rate`` longer per unit of its
    coordinate; it lies along local axis ``along`` (0, 1, 2).

    The coordinate is that of the commanded pose, before any load. ``joint`` is a joint of one axis in the
    spring's own sequence, else in the nearest around it, else a full name.
    """

    joint: str
    length: float
    along: int = 0
    at: float = 0.0
    rate: float = 1.0


@dataclass(frozen=True)
class TableStroke:
    """Compliances (6x6, SI) at coordinates ``at`` of joint ``joint``, linear in between; outside there is none.

    The spring's ``compliance`` stands for the first row: where it has been changed, all rows are (`present_rows`).
    Coordinate and name of the joint are as for `BeamStroke`.
    """

    joint: str
    at: tuple[float, ...]
    rows: tuple[Matrix6, ...]


def present_rows(stroke: TableStroke, compliance: Matrix6) -> tuple[Matrix6, ...]:
    """Rows of a table of which the first is now ``compliance``: every entry changes in the ratio in which that
    of the first row did, one that is zero there as the two diagonal terms next to it."""
    if compliance == stroke.rows[0]:
        return stroke.rows
    first = np.array(stroke.rows[0])
    known = first != 0.0
    ratio = np.divide(compliance, first, out=np.ones((6, 6)), where=known)
    own = np.diag(ratio)
    return tuple(as_rows(row * np.where(known, ratio, np.sqrt(np.outer(own, own)))) for row in stroke.rows)

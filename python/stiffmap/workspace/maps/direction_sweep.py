"""Equilibria under a force that turns in a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.solution import Solution
from stiffmap.workspace.maps.fixed_order_sums import apply
from stiffmap.workspace.maps.loading import Loading, without_failed


@dataclass(frozen=True)
class DirectionSweep:
    """Equilibria of poses (p) under force directions (k)."""

    angle: Floats
    """(p, k) rad, from the plane's first axis to its second."""
    translation: Floats
    """(p, k, 3) m; NaN where the status is not CONVERGED."""
    turning: Floats
    """(p, k, 3) m/rad: change of the translation with the angle, by the loaded compliance."""
    growing: Floats
    """(p, k, 3) m/N: change of the translation with the force's magnitude."""
    status: NDArray[np.uint8]
    """(p, k)."""

    def join(self, other: DirectionSweep) -> DirectionSweep:
        """Directions of both."""
        pairs = ((getattr(self, n), getattr(other, n)) for n in self.__dataclass_fields__)
        return DirectionSweep(*(np.concatenate(pair, axis=1) for pair in pairs))

    def pick(self, column: NDArray[np.intp]) -> DirectionSweep:
        """One direction per pose, column (p,)."""
        row = np.arange(len(column))
        return DirectionSweep(*(getattr(self, n)[row, column][:, None] for n in self.__dataclass_fields__))


def direction(angle: Floats, axes: tuple[int, int]) -> Floats:
    """Unit vectors (..., 3)."""
    out = np.zeros((*angle.shape, 3))
    out[..., axes[0]], out[..., axes[1]] = np.cos(angle), np.sin(angle)
    return out


def solve_directions(
    loading: Loading, position: Floats, angle: Floats, force: float | Floats, axes: tuple[int, int]
) -> DirectionSweep:
    """Equilibria at positions (p, 3) under pure forces (N; one, or one per pose) at angles (p, k)."""
    size = np.broadcast_to(np.reshape(force, (-1, 1)), angle.shape)
    along = direction(angle, axes)
    wrench = np.concatenate([size[..., None] * along, np.zeros_like(along)], axis=-1)
    return direction_sweep_of(loading.solve(position[:, None], wrench), angle, size, axes)


def direction_sweep_of(s: Solution, angle: Floats, size: Floats, axes: tuple[int, int]) -> DirectionSweep:
    """Equilibria (p, k) that have been solved for forces of those sizes (N) and angles."""
    along, across = direction(angle, axes), direction(angle + np.pi / 2, axes)
    c = s.compliance[..., :3, :3]
    return DirectionSweep(
        angle=angle,
        translation=without_failed(s.displacement[..., :3], s.status),
        turning=size[..., None] * apply(c, across),
        growing=apply(c, along),
        status=s.status,
    )


def even_angles(count: int) -> Floats:
    """Equally spaced angles (rad) from 0."""
    return np.asarray(2 * np.pi / count * np.arange(count), dtype=float)


def even_directions(
    loading: Loading, position: Floats, force: float, axes: tuple[int, int], count: int
) -> DirectionSweep:
    """Equilibria under `count` equally spaced directions, the first along the plane's first axis."""
    angle = np.broadcast_to(even_angles(count), (len(position), count))
    return solve_directions(loading, position, angle, force, axes)

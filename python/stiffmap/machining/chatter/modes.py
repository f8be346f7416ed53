"""Modes at the tool as rows: frequency Hz, damping ratio, modal mass kg, direction; from a user or from a machine."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.broadcasting import Floats, instance_of, real_array, real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.workspace.vibration.modes import TipModes

ROW = "(frequency Hz, damping ratio, mass kg, direction)"
WAYS = {
    f"{sign}{axis}": one * way
    for sign, one in (("", 1), ("-", -1))
    for axis, way in zip("xyz", np.eye(3), strict=True)
}


@dataclass(frozen=True, eq=False)
class ToolModes:
    """Modes of the tool's tip in the axes of their directions, SI."""

    frequency: Floats
    """(modes,) Hz."""
    ratio: Floats
    mass: Floats
    """kg, for directions of length one."""
    way: Floats
    """(modes, 3) unit vectors."""
    rest: Floats
    """(3, 3) m/N that follows a force at once."""

    def __len__(self) -> int:
        return len(self.frequency)

    @property
    def stiffness(self) -> Floats:
        """(modes,) N/m."""
        return np.asarray(self.mass * (2 * np.pi * self.frequency) ** 2)

    def turned(self, axes: Floats) -> ToolModes:
        """The same along the rows of `axes` (3, 3)."""
        return replace(self, way=self.way @ axes.T, rest=axes @ self.rest @ axes.T)

    def receptance(self, frequency: Floats) -> np.ndarray:
        """(frequencies, 3, 3) m/N at Hz."""
        w, own = 2 * np.pi * frequency[:, None], 2 * np.pi * self.frequency
        each = 1 / (self.mass * (own**2 - w**2 + 2j * self.ratio * own * w))
        return np.asarray(np.einsum("fk,ki,kj->fij", each, self.way, self.way) + self.rest)

    def below(self, highest: float, share: float = 1e-3) -> ToolModes:
        """Modes up to `highest` Hz that give at least `share` of the largest compliance; the others follow at once."""
        soft = 1 / self.stiffness
        keep = (self.frequency <= highest) & (soft >= share * soft.max(initial=0.0))
        if not keep.any():
            keep = self.frequency == self.frequency.min()
        rest = self.rest + np.einsum("k,ki,kj->ij", soft[~keep], self.way[~keep], self.way[~keep])
        return ToolModes(self.frequency[keep], self.ratio[keep], self.mass[keep], self.way[keep], rest)

    def and_also(self, more: ToolModes) -> ToolModes:
        """In series with others: both move the tool."""
        join = np.concatenate
        return ToolModes(
            join([self.frequency, more.frequency]), join([self.ratio, more.ratio]), join([self.mass, more.mass]),
            join([self.way, more.way]), self.rest + more.rest,
        )  # fmt: skip


def mode_rows(modes: ToolModes | Iterable[object]) -> ToolModes:
    """Rows (frequency Hz, damping ratio, mass kg, direction), the direction x, y, z or a vector; checked."""
    if isinstance(modes, ToolModes):
        return modes
    rows = list(instance_of(modes, Iterable, "modes", f"rows {ROW}"))
    if not rows:
        raise StiffmapError(f"modes: expected rows {ROW}, got none")
    f, ratio, mass, way = map(np.array, zip(*(_row(i, row) for i, row in enumerate(rows)), strict=True))
    return ToolModes(f, ratio, mass, way, np.zeros((3, 3)))


def _row(i: int, row: object) -> tuple[float, float, float, Floats]:
    name = f"modes, row {i + 1}"
    given = list(row) if isinstance(row, Iterable) else []
    if len(given) < 3:
        raise StiffmapError(f"{name}: expected {ROW}, got {row!r}")
    way = given[3] if len(given) == 4 else given[3:]
    values = [real_number(v, name, "numbers") for v in given[:3]]
    for value, what in zip(values, ("a frequency (Hz)", "a damping ratio", "a mass (kg)"), strict=True):
        if not (np.isfinite(value) and value > 0):
            raise StiffmapError(f"{name}: expected {what} above zero, got {value:g}")
    if values[1] >= 1:
        raise StiffmapError(f"{name}: expected a damping ratio below 1 (0.02 is 2 %), got {values[1]:g}")
    return values[0], values[1], values[2], _direction(name, way)


def _direction(name: str, way: object) -> Floats:
    v = np.array(WAYS.get(way, ())) if isinstance(way, str) else real_array(way, name, "a direction")
    if v.shape == (2,):
        v = np.append(v, 0.0)
    if v.shape != (3,) or not np.isfinite(v).all() or not np.linalg.norm(v) > 0:
        raise StiffmapError(f"{name}: expected a direction x, y, z or three numbers, got {way!r}")
    return np.asarray(v / np.linalg.norm(v))


def modes_of_machine(modes: TipModes, i: int = 0) -> ToolModes:
    """Those of one pose, base axes: translations only, damping of each mode alone. StiffmapError where the pose failed."""
    if not np.isfinite(modes.rest[i, 0, 0]):
        raise StiffmapError(f"pose {i + 1}: no equilibrium (status {int(modes.status[i])}), so no modes")
    square, b = modes.square[i], modes.tip[i, :3]
    size = (b**2).sum(axis=0)
    still = modes.rest[i, :3, :3]
    moves = (square > 0) & (size > 0)
    rest = still + b[:, ~moves] @ b[:, ~moves].T
    b, square, size = b[:, moves], square[moves], size[moves]
    f = 1 / (2 * np.pi * np.sqrt(square))
    return ToolModes(f, modes.ratio[i][moves], square / size, (b / np.sqrt(size)).T, rest)

"""Modes at the tool as rows (frequency Hz, damping ratio, modal mass kg, direction), from a user or from a machine; how the cutting force
follows the difference of two passes: per metre of depth, over a tooth period (docs/theory.md V4), and stability by
semi-discretization: the largest multiplier of a tooth period (docs/theory.md V5; Insperger and Stépán).

Axes: feed, normal (left of the feed, seen against the tool), tool axis from holder to tip, as in `process`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import (
    Floats,
    instance_of,
    real_array,
    real_number,
    refused,
    thread_count,
    whole_number,
)
from stiffmap.common.errors import StiffmapError
from stiffmap.machining.process.description import EndMill, Process, own_arc, with_coefficients
from stiffmap.machining.process.load import GivenProcess, as_process, spindle_rate
from stiffmap.model.files.schema.base import NAMED
from stiffmap.solve.compiled import multipliers
from stiffmap.workspace.maps.inputs import unit
from stiffmap.workspace.vibration.modes import TipModes

ROW = "(frequency Hz, damping ratio, mass kg, direction)"


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
    v = np.array(NAMED.get(way, ())) if isinstance(way, str) else real_array(way, name, "a direction")
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


def milling_process(process: GivenProcess) -> Process:
    """The process with a law of chips; StiffmapError where its tool has no teeth, since nothing then regenerates."""
    p = with_coefficients(as_process(process))
    if not p.tool.teeth or not isinstance(p.law, EndMill):
        raise StiffmapError(
            f"process {p.name}: a coated tool has no teeth whose passes a chip could remember; stability lobes "
            "need a tool with teeth and a law end_mill or kienzle"
        )
    return p


def chips(process: Process, intervals: int) -> Floats:
    """(intervals, 3, 2) N/m² on the tool: force per depth by what two passes differ by along feed and normal, exact
    means over equal parts of a tooth period. Helix and run-out are left out."""
    p, law = process, process.law
    assert isinstance(law, EndMill)
    first, last = own_arc(p)
    t, r, a = law.Ktc, law.Krc, law.Kac
    pitch = 2 * pi / p.tool.teeth
    edges = pitch * np.arange(intervals + 1) / intervals
    out = np.zeros((intervals, 3, 2))
    for tooth in range(p.tool.teeth):
        at = edges + tooth * pitch
        low, high = np.clip(at[:-1], first, last), np.clip(at[1:], first, last)
        # integrals of sin cos, sin², cos², sin, cos
        half, twice = (high - low) / 2, (np.sin(2 * high) - np.sin(2 * low)) / 4
        sc, ss, cc = (np.sin(high) ** 2 - np.sin(low) ** 2) / 2, half - twice, half + twice
        s, c = np.cos(low) - np.cos(high), np.sin(high) - np.sin(low)
        rows = [[-t * sc - r * ss, -t * cc - r * sc], [t * ss - r * sc, t * sc - r * cc], [a * s, a * c]]
        out += np.moveaxis(np.array(rows), 2, 0)
    return out / (pitch / intervals)


def mean_chips(process: Process) -> Floats:
    """(3, 2) N/m²: the mean over a tooth period."""
    return np.asarray(chips(process, 1)[0])


def cut_axes(feed: ArrayLike, tool: ArrayLike) -> Floats:
    """(3, 3) rows feed, normal, tool axis of a feed and of the tool from tip to holder, both in base axes."""
    along, ahead = unit(tool, "tool"), unit(feed, "feed")
    ahead = ahead - (ahead @ along) * along
    size = float(np.linalg.norm(ahead))
    if size < 1e-6:
        raise StiffmapError("feed: expected a direction across the tool, got one along it")
    ahead = ahead / size
    return np.stack([ahead, np.cross(along, ahead), -along])


def spindle_speed(speed: object, process: Process) -> float:
    """rad/s of a number in rad/s, or text such as 5000 rpm; None: the process's own."""
    if speed is None:
        return process.spindle
    what = "a spindle speed above zero in rad/s, or text such as '5000 rpm'"
    out = spindle_rate(speed.strip()) if isinstance(speed, str) else real_number(speed, "speed", what)
    if not 0 < out < np.inf:
        raise refused("speed", what, repr(speed))
    return out


INTERVALS = 80
"""Parts of a tooth period."""


def floquet_multiplier(
    modes: ToolModes | Iterable[object],
    process: GivenProcess,
    speed: float | str | None = None,
    depth: float | None = None,
    intervals: int = INTERVALS,
) -> float:
    """Size of the largest multiplier of a tooth period; the cut is stable below 1.

    Parameters
    ----------
    modes
        Rows (frequency Hz, damping ratio, mass kg, direction), directions in the axes feed (x), normal (y), tool (z).
    process
        Tool, law and cut: a `Process`, a name, a file or a mapping.
    speed
        Spindle, rad/s, or text such as '5000 rpm'; None: the process's.
    depth
        Along the tool, m; None: the process's.
    intervals
        Parts of a tooth period; the error falls with the square of their number.

    Raises StiffmapError for bad input. Source: docs/theory.md, V5.
    """
    p = milling_process(process)
    w = spindle_speed(speed, p)
    a = p.cut.axial if depth is None else real_number(depth, "depth", "a depth of cut in m")
    if not 0 <= a <= 1:
        raise StiffmapError(f"depth: expected a depth of cut in m, from 0 to 1, got {a:g}")
    k = whole_number(intervals, "intervals", 2, 10_000)
    return float(multiplier_map(mode_rows(modes), p, np.array([w]), np.array([a]), k, 1)[0, 0])


def multiplier_map(
    modes: ToolModes,
    process: Process,
    speed: Floats,
    depth: Floats,
    intervals: int = INTERVALS,
    threads: int | None = None,
) -> Floats:
    """(speeds, depths) of rad/s and m; `modes` in the axes of the cut."""
    period = 2 * pi / (process.tool.teeth * np.asarray(speed, dtype=float))
    return multipliers(
        2 * pi * modes.frequency, modes.ratio, modes.mass, modes.way, modes.rest,
        chips(process, intervals), period, np.ascontiguousarray(depth, dtype=float), thread_count(threads),
    )  # fmt: skip

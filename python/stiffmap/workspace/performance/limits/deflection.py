"""Largest deflection of the loaded machine over directions and over a box, a path or a list of poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, trailing, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.solve.solution import Solution
from stiffmap.solve.status import Status
from stiffmap.workspace.maps.inputs import box_nodes, magnitude, plane_axes, read_box
from stiffmap.workspace.maps.loading import Loading

TURNS = 12
REFINEMENTS = 4


@short_repr
@dataclass(frozen=True, eq=False)
class WorstDeflection:
    """The largest deflection that was found, and the one at each pose asked for."""

    value: float
    """m; NaN where any pose failed."""
    position: Floats
    """(3,) m, where."""
    direction: Floats
    """(3,) unit vector of the force, base axes; NaN with `value`, as `position` is then a pose that failed."""
    values: Floats
    """(n,) m at each pose."""
    positions: Floats
    """(n, 3) m."""
    directions: Floats
    """(n, 3), NaN where the pose failed."""
    status: NDArray[np.uint8]
    """(n,) highest status among the directions of a pose."""
    force: float
    plane: str | None
    linear: bool


@takes_machine
@spelled_out(LoadingKeywords)
def worst_deflection(
    machine: Machine,
    position: ArrayLike | None = None,
    *,
    box: ArrayLike | None = None,
    force: float,
    plane: str | None = "xy",
    direction: ArrayLike | None = None,
    nodes: int = 7,
    refine: bool = True,
    turns: int = TURNS,
    linear: bool = False,
    **given: Unpack[LoadingKeywords],
) -> WorstDeflection:
    """Largest deflection of the TCP under a force that may point anywhere in a plane or in space.

    Parameters
    ----------
    position
        (n, 3) m, poses or a path; None: a grid of `nodes` per axis over the box.
    box
        (2, 3) m, lowest and highest corner; None: the machine's workspace.
    force
        Size, N.
    plane
        ``xy``, ``xz``, ``yz``: directions of the force and components of the deflection that count;
        None: all of space.
    direction
        (3,) or (n, 3): the force's direction, where it is known (along a toolpath); deflections in
        `plane` (None: in space) count.
    refine
        Search between the nodes of the box about the worst one.
    turns
        Most improvements of the direction at each pose; 0: the unloaded compliance's weakest one is taken.
    linear
        Unloaded compliance times force, by superposition. Otherwise the equilibrium under each force.

    Raises
    ------
    StiffmapError
        For bad input, never for a pose.
    """
    force = magnitude(force, "force", "N")
    whole_number(turns, "turns", 0)
    axes = [0, 1, 2] if plane is None else list(plane_axes(plane))
    ask = _Ask(Loading(machine, **given), force, plane, axes, direction, linear, turns)
    if position is not None:
        if box is not None:
            raise StiffmapError("worst_deflection: expected position or box, got both")
        p = trailing(position, (3,), "position", "positions (m)").reshape(-1, 3)
        if not len(p):
            raise StiffmapError("position: expected at least one, got none")
        return ask.worst(p)
    low, high = read_box(machine, box)
    out = ask.worst(box_nodes(low, high, nodes))
    return _refined(ask, out, low, high, nodes) if refine and direction is None else out


@dataclass(frozen=True, eq=False)
class _Ask:
    loading: Loading
    force: float
    plane: str | None
    axes: list[int]
    direction: ArrayLike | None
    linear: bool
    turns: int

    def _solve(self, p: Floats, unit: Floats, stiffness: bool) -> Solution:
        wrench = np.concatenate([self.force * unit, np.zeros_like(unit)], axis=1)
        return self.loading.solve(p, wrench, stiffness=stiffness)

    def worst(self, p: Floats) -> WorstDeflection:
        """The largest deflection at poses (n, 3), and that of each."""
        value, unit, status = self._at(p)
        good = (status == Status.CONVERGED) & np.isfinite(value)
        value, unit = np.where(good, value, np.nan), np.where(good[:, None], unit, np.nan)
        i = int(np.argmax(value))  # the first that failed, if any did: NaN comes before all numbers
        worst = float(value[i])
        return WorstDeflection(
            worst, p[i], unit[i], value, p, unit, status, self.force, self.plane, self.linear
        )

    def _at(self, p: Floats) -> tuple[Floats, Floats, NDArray[np.uint8]]:
        """Largest deflections, their directions and the status at poses (n, 3)."""
        axes, unit = self.axes, np.zeros((len(p), 3))
        start = self._solve(p, unit, stiffness=True)
        if self.direction is not None:
            unit = trailing(self.direction, (3,), "direction", "directions")
            size = np.linalg.norm(unit, axis=-1, keepdims=True)
            if unit.shape not in ((3,), (1, 3), p.shape) or not (np.isfinite(size) & (size > 0)).all():
                raise StiffmapError(f"direction: expected one or {len(p)} vectors of 3 finite numbers, not all 0, "
                                    f"got {unit.tolist()}")  # fmt: skip
            unit = np.broadcast_to(unit / size, p.shape)
            return self._loaded(p, unit, start)
        unit[:, axes] = np.linalg.svd(np.nan_to_num(start.compliance[:, axes][:, :, axes]))[2][:, 0]
        value, way, status = self._loaded(p, unit, start)
        if self.turns == 0:
            return value, way, status
        other = self._loaded(p, -unit, start)
        flip = other[0] > value
        value, way = np.where(flip, other[0], value), np.where(flip[:, None], -unit, way)
        status = np.maximum(status, other[2])
        return (value, way, status) if self.linear else self._turned(p, value, way, status)

    def _loaded(self, p: Floats, unit: Floats, start: Solution) -> tuple[Floats, Floats, NDArray[np.uint8]]:
        """Under the force along `unit`, the compliance being that of another equilibrium there."""
        if self.linear:
            moved = (start.compliance[:, :3, :3] @ unit[..., None])[..., 0]
            d, status = start.displacement[:, :3] + self.force * moved, start.status
        else:
            s = self._solve(p, unit, stiffness=False)
            d, status = s.displacement[:, :3], np.maximum(start.status, s.status)
        return np.linalg.norm(d[:, self.axes], axis=1), unit, status

    def _turned(
        self, p: Floats, value: Floats, unit: Floats, status: NDArray[np.uint8]
    ) -> tuple[Floats, Floats, NDArray[np.uint8]]:
        """Turns each force to where the loaded compliance says that the deflection grows."""
        axes = self.axes
        for _ in range(self.turns):
            s = self._solve(p, unit, stiffness=True)
            d = s.displacement[:, axes]
            grow = (np.swapaxes(s.compliance[:, axes][:, :, axes], 1, 2) @ d[..., None])[..., 0]
            with np.errstate(invalid="ignore", divide="ignore"):
                grow = grow / np.linalg.norm(grow, axis=1, keepdims=True)
            turned = unit.copy()
            turned[:, axes] = np.where(np.isfinite(grow), grow, unit[:, axes])
            far = np.linalg.norm(turned - unit, axis=1)
            now, _, state = self._loaded(p, turned, s)
            better = now > value
            value, unit = np.where(better, now, value), np.where(better[:, None], turned, unit)
            status = np.maximum(status, state)
            if not (better & (far > 1e-5)).any():
                break
        return value, unit, status


def _refined(ask: _Ask, out: WorstDeflection, low: Floats, high: Floats, nodes: int) -> WorstDeflection:
    if not np.isfinite(out.value):
        return out
    best, at, unit = out.value, out.position, out.direction
    h = (high - low) / (nodes - 1)
    around = np.array([*product((-1.0, 0.0, 1.0), repeat=3)])
    for _ in range(REFINEMENTS):
        h = h / 2
        p = np.unique(np.clip(at + around * h, low, high), axis=0)
        tried = ask.worst(p)
        if not tried.value <= best:
            best, at, unit = tried.value, tried.position, tried.direction
        if not np.isfinite(best):  # a pose of the box has no equilibrium
            break
    return replace(out, value=best, position=at, direction=unit)

"""A machine in a state: where it can be, and everything that is drawn and said of it. Immutable, so that it may be worked out while a
hand goes on."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.budget import DeflectionBudget, deflection_budget
from stiffmap.solve.compiled import Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.solution import Solution
from stiffmap.ui.plot.loaded import SHOWN, round_factor
from stiffmap.ui.plot.scene import box_corners
from stiffmap.ui.plot.skeleton import Skeleton, skeleton, standing
from stiffmap.ui.view.plane import NO_LINES, QUANTITIES, Frame, PlaneMap
from stiffmap.ui.view.state import ViewState
from stiffmap.workspace.maps.inputs import box_nodes
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies, natural_frequencies
from stiffmap.workspace.vibration import frequency_response

SMALL_TURN = 0.03  # rad, with which it is tried whether a machine turns
DEFAULT_BOX = 0.25  # of the machine's length, half edge of the box of a machine that declares none
WIDE = 0.5  # of the longest commanded edge of the box, edge of the plane along what is not commanded


def box_of(machine: Machine) -> tuple[Floats, Floats]:
    """Lowest and highest corner (m): the workspace of the file, else a cube about home."""
    if machine.description.workspace is not None:
        low, high = machine.workspace
        return low, high
    home = machine.description.home.p
    half = DEFAULT_BOX * machine.compiled.length
    return home - half, home + half


def drawn_box(machine: Machine) -> tuple[Floats, Floats]:
    """The box of the plane: where an axis is not commanded, wide enough to see the colours, which it does not change."""
    low, high = (v.copy() for v in box_of(machine))
    free = np.array(moves(machine))
    if free.any():
        least = WIDE * float((high - low)[free].max())
        for i in np.flatnonzero(~free & (high - low < least)):
            middle = machine.description.home.p[i]
            low[i], high[i] = middle - least / 2, middle + least / 2
    return low, high


@lru_cache(maxsize=32)
def turns(machine: Machine) -> tuple[bool, bool, bool]:
    """About which axes of the tool the machine can turn near home."""
    home = machine.description.home
    steps = [Rotation.from_rotvec(SMALL_TURN * e).as_matrix() for e in np.eye(3)]
    named = [f"r{a}" in machine.description.task for a in "xyz"]
    k = inverse_kinematics(machine, home.p, np.array([home.r @ s for s in steps]))
    good = np.asarray(k.status) == Status.CONVERGED
    x, y, z = (bool(n and g) for n, g in zip(named, good, strict=True))
    return x, y, z


def moves(machine: Machine) -> tuple[bool, bool, bool]:
    """Along which base axes the tool is commanded."""
    x, y, z = (a in machine.description.task for a in "xyz")
    return x, y, z


FINE, COARSE, DEAR = 101, 51, 15
"""Poses along each edge: at rest, while something is dragged, and of quantities that need modes."""
MODES = 40  # as parallel machines have dozens of modes of their bars below those that move the tool
DAMPING = 0.02  # modal damping ratio of every mode
INSIDE = 1e-9  # of the box, how far outside it a pose may lie by round-off
CLOUD = 15  # poses of the cloud along each commanded axis


@dataclass(frozen=True)
class Moment:
    """The machine with its changed numbers, and the state."""

    machine: Machine
    state: ViewState
    meshes: Path | None = None
    """The URDF whose meshes are drawn."""

    @property
    def rotation(self) -> Floats:
        """(3, 3) commanded orientation."""
        turned = self.state.turned
        return np.asarray(self.machine.compiled.home_rotation if turned is None else turned)

    @property
    def _how(self) -> dict[str, Any]:
        return {"rotation": self.state.turned, "gravity": self.state.gravity}

    def solve(self, position: Floats | None = None, *, stiffness: bool = True) -> Solution:
        """Under the load, at the tool's pose or at positions (..., 3) m with its orientation."""
        s = self.state
        at, threads = (s.position, 1) if position is None else (position, None)
        return self.machine.solve(
            at, s.wrench, **self._how, start=s.start_array, stiffness=stiffness, threads=threads
        )

    def frame(self) -> Frame:
        """The rectangle across the workspace box that holds the tool."""
        low, high = drawn_box(self.machine)
        s, p, axes = self.state, np.array(self.state.position), np.eye(3)
        if s.plane == "free":
            n = np.array(s.normal) / np.linalg.norm(s.normal)
            u = np.cross(axes[int(np.argmin(np.abs(n)))], n)
            u /= np.linalg.norm(u)
            v = np.cross(n, u)
        else:
            u, v = np.delete(axes, "xyz".index(s.plane), axis=0)
        along = box_corners(low, high) @ np.stack([u, v], axis=1)
        lowest, highest = along.min(axis=0), along.max(axis=0)
        right, up = (lowest + highest) / 2
        width, height = map(float, highest - lowest)
        return Frame(p + (right - p @ u) * u + (up - p @ v) * v, u, v, width, height)

    def plane(self, count: int = FINE) -> PlaneMap:
        """The plane through the tool; outside the box its poses are solved as well and hidden."""
        begun = time.perf_counter()
        frame = self.frame()
        if QUANTITIES[self.state.quantity].of is None:
            count = min(count, DEAR)
        p = frame.poses(count)
        low, high = drawn_box(self.machine)
        slack = INSIDE * (high - low)
        outside = np.asarray(((p < low - slack) | (p > high + slack)).any(axis=-1))
        values, status = self.at(p)
        values = np.where(outside, np.nan, values)
        return PlaneMap(frame, self.state.quantity, values, status, outside, time.perf_counter() - begun)

    def at(self, position: Floats) -> tuple[Floats, Floats]:
        """(...) of the quantity with the tool at (..., 3) m, SI, solved there, and statuses."""
        quantity = QUANTITIES[self.state.quantity]
        if self.state.quantity == "frequency":
            w = self.modes(position, 1)
            return np.asarray(w.frequency[..., 0]), np.asarray(w.status, dtype=float)
        if quantity.of is None:
            return self.dynamic_stiffness(position)
        s = self.solve(position, stiffness=quantity.stiffness)
        size = float(np.linalg.norm(self.state.force))
        return quantity.of(s, size, self.state.tolerance), np.asarray(s.status, dtype=float)

    def modes(self, position: ArrayLike, count: int) -> NaturalFrequencies:
        """The lowest modes at (..., 3) m under the load; StiffmapError where bodies lack masses."""
        return natural_frequencies(self.machine, position, self.state.wrench, **self._how, modes=count)

    def dynamic_stiffness(self, position: Floats) -> tuple[Floats, Floats]:
        """(...) N/m of the softest direction at the state's frequency, and statuses; modes beyond the lowest count as statics."""
        s = self.state
        found = frequency_response(
            self.machine, position, [s.frequency], s.wrench, **self._how, damping=DAMPING, modes=MODES,
            symmetrise=True,
        )  # fmt: skip
        c = found.values[..., 0, :3, :3]
        good = np.isfinite(c).all(axis=(-2, -1))
        softest = np.linalg.norm(np.where(good[..., None, None], c, np.eye(3)), 2, axis=(-2, -1))
        return np.where(good, 1.0 / softest, np.nan), np.asarray(found.status, dtype=float)

    def cloud(self) -> tuple[Floats, Floats]:
        """The quantity over the whole box: points (n, 3) m, values (n,) in the unit of the screen; none where it needs modes."""
        quantity, at = QUANTITIES[self.state.quantity], self.state.position
        if quantity.of is None:
            return np.zeros((0, 3)), np.zeros(0)
        low, high = (np.where(moves(self.machine), end, at) for end in box_of(self.machine))
        points = box_nodes(low, high, CLOUD)
        return points, self.at(points)[0] * quantity.factor

    def rest(self) -> Skeleton:
        """The machine at its pose, springs at rest."""
        s = self.state
        return standing(self.machine, s.position, s.turned, start=s.start_array)

    def ghost(self, rest: Skeleton, solution: Solution) -> Floats:
        """(n, 2, 3) m, links of the machine under the load, its deflection magnified; none without an equilibrium."""
        factor = self.magnification(rest, solution)
        if not bool(solution.ok) or factor == 0:
            return NO_LINES
        return rest.enlarged(skeleton(self.machine, solution.coordinates), factor).links

    def magnification(self, rest: Skeleton, solution: Solution) -> float:
        """Of the deflected machine: as the state says, else a round factor."""
        if self.state.magnification is not None:
            return self.state.magnification
        d = float(np.linalg.norm(np.nan_to_num(solution.displacement[:3])))
        return round_factor(SHOWN * rest.extent, d)

    def shares(self) -> DeflectionBudget:
        """Where the deflection comes from; StiffmapError where there is no equilibrium or another assembly mode."""
        s = self.state
        if s.start is not None:
            raise StiffmapError("shares of the deflection are known in the assembly mode of home only")
        return deflection_budget(self.machine, s.position, s.wrench, **self._how)

    def map_key(self, *, anywhere: bool = False) -> object:
        """What the colours of a plane (or, `anywhere`, of the box) depend on."""
        m, s = self.machine, self.state
        along = s.position if s.plane == "free" else s.position["xyz".index(s.plane)]
        place = () if anywhere else (along, s.plane, s.normal if s.plane == "free" else None)
        idle = tuple(s.position[i] for i, a in enumerate("xyz") if a not in m.description.task)
        return (
            id(m), place, idle, s.rotation, s.wrench, s.gravity, s.quantity, s.frequency, s.start, s.tolerance,
        )  # fmt: skip

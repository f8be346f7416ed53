"""A machine as the C++ core holds it."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stiffmap import _core
from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import MachineDescription
from stiffmap.model.description.machine import GRAVITY_LIMIT
from stiffmap.model.description.tree import joints, of_same_sequence
from stiffmap.solve.compiled.lowering import build_mechanism
from stiffmap.solve.compiled.names import Names, names_of


class CompiledMachine:
    """The compiled mechanism of a description, its kernel plan, and every call on them.

    Calls take C-contiguous arrays with one leading axis of poses, SI, base axes; the public functions broadcast
    and check before they call. Immutable; may be shared by threads.

    What needs no more than the mechanism is asked of `core`: ``bodies``, name, frame and mass (kg) of each; ``limits``, lowest and
    highest value of each coordinate, 1e300 where there is no limit; ``redundancy``, motions of the drives that a commanded pose leaves
    open; and what gives arrays by name (cpp/include/stiffmap/solve/poses.hpp).
    ``kinematics``: closed coordinates and the drives' Jacobian of (n, 3) positions, from `start` (n, coordinates) near the answer, NaN
    where none is known; not `patient`: a pose that straight continuation from home does not reach is out of reach; `only`: so is one
    that its start does not lead to; `weights` (drives,) of what drives that outnumber the freedoms share (theory D10), (0,): their own.
    ``enclose``: what holds over the cells (n, 3) centre, half lengths along the columns of axes (3, 3); `slopes`: 3 columns
    (translations) or 6 (twists) of the coordinates' slopes; `watched`: frames whose motion is bounded. ``dynamics``: inverse dynamics at
    (n, coordinates) that are closed, motions of the tcp (n, 6); `rates`, `accelerations`: (n, drives) where the tcp's motion leaves some
    open, (0, drives): it decides them. ``modes``: the lowest at a point, damping between them, the flexibility of all others; `viscous`,
    `loss`: (coordinates,); `closed`: (n, coordinates) closed at the poses; `whole`: of a tangent that is not symmetric as it is, with
    the motion of all coordinates. ``clamp``: what keeps a point at (n, 6) displacements from its commanded poses. ``reactions``:
    (n, coordinates) N or N·m of every spring, drive and locked coordinate, reference path. ``point_positions``: (n, 3) m of a named
    point at (n, coordinates), nominal geometry. ``solve``: equilibria of (n, 3) positions, (n or 1, 3, 3) rotations and (n or 1, load
    points, 6) wrenches; `closed`: (n, coordinates) already closed at these poses, NaN out of reach, None: found by closure.
    """

    def __init__(
        self, description: MachineDescription, start_nodes: int = 8, like: CompiledMachine | None = None
    ) -> None:
        self.description = description
        self._start_nodes = start_nodes
        self.core: _core.Mechanism = build_mechanism(description, like.core if like else None)

    @cached_property
    def names(self) -> Names:
        """Names of everything in the mechanism."""
        return names_of(self.core)

    @cached_property
    def coupling(self) -> Floats:
        """(a, a) what a controller shows of the coordinates of its drives."""
        names, drives = self.names.actuators, joints(self.description)
        out = np.eye(len(names))
        for i, name in enumerate(names):
            for other, share in drives[name].coupled if name in drives else ():
                out[i, names.index(of_same_sequence(name, other))] -= share
        return out

    @cached_property
    def home_rotation(self) -> Floats:
        """(3, 3) orientation of the tcp at home."""
        return self.description.home.r

    @cached_property
    def spun_balls(self) -> dict[str, tuple[Floats, Floats]]:
        """Ball joints next to a rod that spins, with axes of their own (docs/theory.md C8): (3, 3) rotation at home, (3, 3)
        axes (rows) in the frame behind it, where the coordinates are zero. Counted from the axes of `charted`."""
        return {
            self.names.coordinates[first].rpartition(".")[0]: (
                np.ascontiguousarray(turn),
                np.ascontiguousarray(axes).T,
            )
            for first, turn, axes in self.core.spun_balls
        }

    @cached_property
    def plan(self) -> _core.FastPlan:
        """What the kernels prepare for the machine: with it the core solves and closes by the fast path, without by the reference path."""
        box = self.description.workspace
        low, high = box if box else ((1.0, 1.0, 1.0), (-1.0, -1.0, -1.0))
        try:
            _core.kernel_level()
        except ValueError as error:  # the environment asks for instructions that there are not
            raise StiffmapError(str(error)) from None
        return _core.FastPlan(self.core, np.array(low), np.array(high), self._start_nodes)

    @cached_property
    def _one(self) -> _core.OneCall:
        return _core.OneCall(self.core, self.plan, self.home_rotation, self.gravity())

    @property
    def not_fast(self) -> str:
        """What the machine lacks for the fast path; empty if nothing."""
        return self.plan.missing

    @property
    def length(self) -> float:
        """Characteristic length, m."""
        return self.core.length

    @property
    def stiffness(self) -> float:
        """Characteristic stiffness, N/m."""
        return self.core.stiffness

    @cached_property
    def nodes(self) -> tuple[tuple[int, int], ...]:
        """Parent and coordinate of each frame; -1: none."""
        return tuple(self.core.nodes)

    @cached_property
    def loops(self) -> tuple[tuple[str, str, int, int], ...]:
        """Block, branch, and the two frames that each loop closes."""
        return tuple(self.core.loops)

    def gravity(self, given: ArrayLike | None = None) -> Floats:
        """(3,) m/s², base axes; the machine file's where nothing is given. StiffmapError for bad numbers."""
        if given is None:
            return np.array(self.description.gravity or (0.0, 0.0, 0.0))
        g = real_array(given, "gravity", "3 finite numbers (m/s², base axes)")
        if g.shape != (3,) or not (abs(g) <= GRAVITY_LIMIT).all():
            raise StiffmapError(f"gravity: expected 3 finite numbers up to 1000 (m/s²), got {given!r}")
        return g

    def solve_one(self, position: object, wrench: object) -> _core.OneAnswer | None:
        """One pose under one wrench at the tcp by the kernels; None for inputs that are not plain numbers."""
        return self._one.solve(position, wrench)

    def close_poses(
        self, position: Floats, rotation: Floats, threads: int, start: Floats | None = None
    ) -> tuple[Any, ...]:
        """Coordinates, position, rotation, status and flags of (n, 3) positions and (n, 3, 3) rotations.

        start: (n, coordinates) on the assembly branch that is meant; None: that of home.
        """
        return tuple(self.core.closure(self.plan, position, rotation, start, threads).values())

    def close_actuators(
        self, actuators: Floats, threads: int, start: Floats | None = None
    ) -> tuple[Any, ...]:
        """The same of (n, actuators) actuator coordinates, continued from home or from `start`."""
        found = self.core.closure(None, actuators, None, start, threads)  # type: ignore[arg-type]
        return tuple(found.values())

    def home_coordinates(self) -> Floats:
        """(coordinates,) at home."""
        return np.asarray(self.core.home_coordinates())

    def path(
        self,
        position: Floats,
        rotation: Floats,
        direction: Floats,
        *,
        point: str,
        gravity: Floats,
        control: str,
        limit: float,
        steps: int,
        cross: int,
    ) -> tuple[Any, ...]:
        """Flags, the path of equilibria and the branch that crosses it: (end, points, critical points) each."""
        how = PATH_CONTROLS.index(control)
        return _core.path(self.core, position, rotation, direction, point, gravity, how, limit, steps, cross)

    @cached_property
    def drives(self) -> tuple[int, ...]:
        """Index of each actuator's coordinate."""
        return tuple(i for _, i in self.core.actuators)

    def frames(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """(nodes, 3) m and (nodes, 3, 3): all frames at given coordinates, nominal geometry."""
        found = self.core.frames(coordinates)
        return found["position"], found["rotation"]


LOAD_TYPES = {"dead": 0, "follower": 1, "semitangential": 2}
PATH_CONTROLS = ("force", "displacement", "arc")
Answer = _core.Answer | _core.OneAnswer
"""Arrays of a call, with one leading axis of poses."""


def kernel_levels() -> list[str]:
    """Instruction sets that this CPU can run, the widest last."""
    return list(_core.kernel_levels())


def multipliers(
    frequency: Floats,
    ratio: Floats,
    mass: Floats,
    way: Floats,
    rest: Floats,
    chips: Floats,
    period: Floats,
    depth: Floats,
    threads: int,
) -> Floats:
    """(periods, depths) size of the largest multiplier of a tooth period.

    (modes,) rad/s, ratio, kg and (modes, 3) unit vectors; (3, 3) m/N that follows at once; (intervals, 3, 2) N/m² means of the
    chip's force; (periods,) s; (depths,) m.
    """
    found = _core.multipliers(frequency, ratio, mass, way, rest, list(chips), period, depth, threads)
    return np.asarray(found["multipliers"])

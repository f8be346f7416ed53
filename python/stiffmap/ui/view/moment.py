"""A machine in a state: everything that is drawn and said of it. Immutable, so that it may be worked out while a hand goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.budget import DeflectionBudget, deflection_budget
from stiffmap.solve.compiled import Status
from stiffmap.solve.machine import Machine
from stiffmap.solve.solution import Solution
from stiffmap.ui.plot.loaded import SHOWN, round_factor
from stiffmap.ui.plot.skeleton import Skeleton, skeleton, standing
from stiffmap.ui.view.place import box_of, moves, orientation, solved
from stiffmap.ui.view.plane import FINE, NO_LINES, PlaneMap, plane_map, values_at
from stiffmap.ui.view.quantities import QUANTITIES
from stiffmap.ui.view.state import ViewState
from stiffmap.workspace.maps.inputs import box_nodes

CLOUD = 15
"""Poses of the cloud along each commanded axis."""


@dataclass(frozen=True)
class Moment:
    """The machine with its changed numbers, and the state."""

    machine: Machine
    state: ViewState
    meshes: Path | None = None
    """The URDF whose meshes are drawn."""

    def solve(self) -> Solution:
        """The tool's pose under the load."""
        return solved(self.machine, self.state, threads=1)

    def plane(self, count: int = FINE) -> PlaneMap:
        """The plane through the tool."""
        return plane_map(self.machine, self.state, count)

    def at(self, point: Sequence[float]) -> tuple[float, Status]:
        """Value (SI) of the quantity with the tool at a point (3,) m, solved there, and the status."""
        value, status = values_at(self.machine, self.state, np.array(point, dtype=float))
        return float(value), Status(int(status))

    def cloud(self) -> tuple[Floats, Floats]:
        """The quantity over the whole box: points (n, 3) m, values (n,) in the unit of the screen; none where it needs modes."""
        quantity, at = QUANTITIES[self.state.quantity], self.state.position
        if quantity.of is None:
            return np.zeros((0, 3)), np.zeros(0)
        low, high = (np.where(moves(self.machine), end, at) for end in box_of(self.machine))
        points = box_nodes(low, high, CLOUD)
        return points, values_at(self.machine, self.state, points)[0] * quantity.factor

    def rest(self) -> Skeleton:
        """The machine at its pose, springs at rest."""
        s = self.state
        return standing(self.machine, s.position, orientation(s), start=s.start_array)

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
        return deflection_budget(
            self.machine, s.position, s.wrench, rotation=orientation(s), gravity=s.gravity
        )

    def map_key(self, *, anywhere: bool = False) -> object:
        """What the colours of a plane (or, `anywhere`, of the box) depend on."""
        m, s = self.machine, self.state
        along = s.position if s.plane == "free" else s.position["xyz".index(s.plane)]
        place = () if anywhere else (along, s.plane, s.normal if s.plane == "free" else None)
        idle = tuple(s.position[i] for i, a in enumerate("xyz") if a not in m.description.task)
        return (
            id(m), place, idle, s.rotation, s.wrench, s.gravity, s.quantity, s.frequency, s.start, s.tolerance,
        )  # fmt: skip

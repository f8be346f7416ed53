"""What many machines near one show beyond it: one step each through the factors of its equilibria (docs/fast_path.md F10).

Readings of displacements at the loaded body alone; everything else is for whole predictions.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import carrier, point_positions, positions_of, rigged, targets
from stiffmap.experiment.prediction.equilibria import moves_unloaded
from stiffmap.experiment.prediction.joints import is_sided, joint_channels
from stiffmap.experiment.readings import kind_of
from stiffmap.model.description import Body, MachineDescription, Offset, Point
from stiffmap.model.description.alike import alike
from stiffmap.solve.machine import Machine
from stiffmap.solve.options import SolveOptions
from stiffmap.solve.solving import Call, fill_holes, solve_call
from stiffmap.solve.status import Flag

MOST_BYTES = 2**25
"""Of the displacements of all machines of one call."""
FEW = 0.05
"""Share of poses of the reference path beyond which machines are solved one by one."""


@dataclass(frozen=True)
class Near:
    """A machine near another."""

    description: MachineDescription
    unmoved: Callable[[], MachineDescription] | None = None
    """The same parts with nothing off, for where the other has not all of them: the machines that have them hold other
    spins, or home was found anew."""


@dataclass(eq=False)
class Nearby:
    """One machine under one plan, and what was solved for others."""

    machine: Machine
    plan: Experiment
    threads: int | None
    solved: int = 0
    """Equilibria of this machine."""

    def changes(self, others: Sequence[Near]) -> list[Floats | None]:
        """(n, c) m, rad each: what other machines show more than this one, to first order in where they differ. None where
        one step does not lead there, where the plan reads what a step does not give, or where the kernels leave too much."""
        out: list[Floats | None] = [None] * len(others)
        if not _steps_show(self.machine, self.plan):
            return out
        for base, members in self._by_base(others):
            found = self._from(base, [m for _, m in members])
            for k, (i, _) in enumerate(members):
                out[i] = None if found is None else found[k]
        return out

    def _by_base(self, others: Sequence[Near]) -> list[tuple[Machine, list[tuple[int, Machine]]]]:
        """Which of the others are reached from which machine: this one, or one with their parts unmoved."""
        mine: list[tuple[int, Machine]] = []
        apart: dict[MachineDescription, tuple[Machine, list[tuple[int, Machine]]]] = {}
        for i, near in enumerate(others):
            if not _step_leads(self.machine, near.description, self.plan):
                continue
            try:
                other = Machine(near.description, like=self.machine)
                if _holds_as(self.machine, other):
                    mine.append((i, other))
                elif near.unmoved is not None:
                    bare = near.unmoved()
                    if bare not in apart:
                        apart[bare] = (Machine(bare, like=self.machine), [])
                    base, members = apart[bare]
                    members += [(i, other)] if _holds_as(base, other) else []
            except StiffmapError:
                continue
        return [(b, m) for b, m in ((self.machine, mine), *apart.values()) if m]

    def _from(self, machine: Machine, others: Sequence[Machine]) -> Floats | None:
        """(others, n, c); None where the kernels leave too many poses."""
        out = np.zeros((len(others), len(self.plan), len(self.plan.channels)))
        if self.plan.quantity == "deflection" and not self.plan.wrench.any():
            return out  # from the state without load to itself
        states = [
            (self.plan, 1.0),
            *([(self.plan.without_load, -1.0)] if self.plan.quantity == "deflection" else []),
        ]
        at_once = max(1, MOST_BYTES // (48 * max(len(self.plan.distinct[0]), 1)) - 1)
        for first in range(0, len(others), at_once):
            some = slice(first, first + at_once)
            for plan, sign in states:
                found = self._states(machine, plan, others[some])
                if found is None:
                    return None
                out[some, :, :6] += sign * found
        return out

    def _states(self, machine: Machine, plan: Experiment, others: Sequence[Machine]) -> Floats | None:
        """(others, n, 6) of one state, loaded or not."""
        out = np.zeros((len(others), len(plan), 6))
        all_move = bool(plan.wrench.any()) or moves_unloaded(machine, plan)
        moved = [i for i, m in enumerate(others) if all_move or moves_unloaded(m, plan)]
        if not moved:
            return out
        read = np.array(targets(machine, plan))
        load = np.array(plan.load_points or (plan.load_point,) * len(plan)) if plan.wrench.any() else read
        for point in np.unique(load):
            here = np.flatnonzero(load == point)
            part = plan if len(here) == len(plan) else plan.rows(here)
            found = self._at_point(machine, part, str(point), [others[i] for i in moved])
            if found is None:
                return None
            out[np.ix_(np.array(moved), here)] = found
        return out

    def _at_point(
        self, machine: Machine, plan: Experiment, point: str, others: Sequence[Machine]
    ) -> Floats | None:
        once, back = plan.distinct
        options = SolveOptions(
            point=point, rotation=once.rotation, gravity=once.gravity, stiffness=False, threads=self.threads
        )
        call = Call(once.position, once.wrench, options)
        # the machine itself is one of the others: what its last step leaves is theirs as well
        same = [machine.compiled, *(m.compiled for m in others)]
        solution, varied = solve_call(machine.compiled, call, same)
        slow = (solution.flags & Flag.REFERENCE_PATH) > 0
        self.solved += len(once)
        untold = solution.ok & np.isnan(varied).any(axis=(-2, -1))
        if (slow | untold).mean() > FEW:
            return None
        varied = fill_holes(machine.compiled, call, same, solution, varied)
        if not np.isfinite(varied[solution.ok]).all():
            return None
        found = np.moveaxis(varied, 1, 0)
        if set(targets(machine, plan)) == {point}:
            return np.asarray((found[1:] - found[:1])[:, back])
        return _seen_at(machine, plan, point, found[:, back])


def _steps_show(machine: Machine, plan: Experiment) -> bool:
    """Whether displacements of the platform are all that a plan reads, and the kernels take the machine."""
    if machine.fast or plan.gravity_of is not None or plan.joints is not None or joint_channels(plan):
        return False
    if any(kind_of(c) for c in plan.extra) or rigged(machine, plan.loop) is not machine:
        return False
    if carrier(machine, plan.loop.instrument_on) or carrier(machine, plan.loop.force_against):
        return False
    points = _points(machine, plan)
    if points != {"tcp"} and not _rigid_platform(machine.description):
        return False
    of_platform = all(p == "tcp" or p.startswith("platform.") for p in points)
    return of_platform and not is_sided(machine.description, plan)


def _step_leads(machine: Machine, other: MachineDescription, plan: Experiment) -> bool:
    """Whether one step from the machine's equilibria leads to those of another."""
    d = machine.description
    heavy = any(plan.gravity or d.gravity or ())
    if heavy and machine.compiled.names.free_spins:  # a weight that is off turns them
        return False
    if not alike(d, other, heavy=heavy) or is_sided(other, plan):
        return False
    return _points(machine, plan) == {"tcp"} or d.platform == other.platform


def _holds_as(machine: Machine, other: Machine) -> bool:
    """Whether both have the same coordinates and hold the same spins."""
    a, b = machine.compiled.names, other.compiled.names
    return (a.coordinates, a.free_spins) == (b.coordinates, b.free_spins) and not other.fast


def _points(machine: Machine, plan: Experiment) -> set[str]:
    """All that are loaded or read."""
    return {*targets(machine, plan), *(plan.load_points or (plan.load_point,))}


def _seen_at(machine: Machine, plan: Experiment, point: str, found: Floats) -> Floats:
    """(others, n, 6) at other points of the same rigid body, from (1 + others, n, 6) at one."""
    arm = positions_of(machine, plan) - point_positions(machine, point, plan)
    motion = found.copy()
    lost = ~np.isfinite(motion).all(axis=-1, keepdims=True)
    turn = Rotation.from_rotvec(np.where(lost, 0.0, motion[..., 3:]).reshape(-1, 3))
    arms = np.broadcast_to(np.nan_to_num(arm), motion.shape[:-1] + (3,)).reshape(-1, 3)
    motion[..., :3] += (turn.apply(arms) - arms).reshape(motion.shape[:-1] + (3,))
    return np.asarray(motion[1:] - motion[:1])


def _rigid_platform(description: MachineDescription) -> bool:
    """Whether all points of the platform stand where they are declared against each other."""
    return all(
        isinstance(e, (Body, Point)) or (isinstance(e, Offset) and e.actual in (None, e.nominal))
        for e in description.platform
    )


K = TypeVar("K", bound=Hashable)
Tell = Callable[[Sequence[K]], Sequence[Floats | None]]


class Ahead(Generic[K]):
    """Slopes by key, in the order in which they will be asked for; each is handed out once.

    tell
        Slopes of some keys; None where whole predictions are needed.
    """

    def __init__(self, keys: Sequence[K], at_once: int, tell: Tell[K]) -> None:
        self._keys, self._at_once, self._tell = keys, at_once, tell
        self._place = {key: i for i, key in enumerate(keys)}
        self._told: dict[K, Floats | None] = {}

    def of(self, key: K) -> Floats | None:
        """(n, c); None where whole predictions are needed, and for what is not among the keys."""
        if key not in self._place:
            return None
        if key not in self._told:
            some = self._keys[self._place[key] :][: self._at_once]
            self._told.update(zip(some, self._tell(some), strict=True))
        return self._told.pop(key)

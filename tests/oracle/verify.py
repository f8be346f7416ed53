"""Whether a batch of answers are equilibria: free bodies (`statics`), and what was asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.model.description import Block, Joint, Law, MachineDescription

from .placed import placed
from .statics import Case, balance, closed, coordinates

Array = np.ndarray
FORCE, CLOSURE, MOTION = 1e-6, 1e-6, 1e-6
LIMITS = {"command": CLOSURE, "closure": CLOSURE, "force": FORCE, "motion": MOTION}


@dataclass(frozen=True)
class Question:
    """What a machine was asked at n poses."""

    machine: sm.Machine
    load: dict[str, Any]
    """Keywords of `Machine.solve`; wrench (n, 6)."""
    at: Array
    """(n, 3) where the TCP is commanded, or (n, actuators) coordinates."""
    before: dict[str, Array]
    """Full name of each coordinate -> (n,) as the controller commands it."""
    size: float
    """Of the machine, m."""
    joints: bool = False
    """`at` are coordinates of the actuators."""

    def of(self, rows: Array) -> Question:
        """Some of the poses."""
        each: dict[str, Any] = {k: self.load[k][rows] for k in ("wrench", "rotation") if k in self.load}
        load: dict[str, Any] = {**self.load, **each}
        return replace(self, load=load, at=self.at[rows], before={n: v[rows] for n, v in self.before.items()})

    def solve(self, machine: sm.Machine | None = None, **change: Any) -> sm.Solution:
        """By this machine, or by another."""
        asked = machine or self.machine
        given: dict[str, Any] = {**self.load, **change}
        return (asked.solve_joints if self.joints else asked.solve)(self.at, threads=1, **given)


@dataclass
class Verdict:
    """Largest relative errors, what is wrong by the pose, how many poses the free bodies cannot decide."""

    worst: dict[str, float] = field(default_factory=dict)
    bad: dict[int, str] = field(default_factory=dict)
    undecided: int = 0


def verified(q: Question, s: sm.Solution, at: Array) -> Verdict:
    """Poses `at` of an answer that have numbers."""
    out = Verdict()
    joints = list(s.joint_index.values())
    patterns, which = np.unique(s.indeterminate_mask[at][:, joints], axis=0, return_inverse=True)
    for k in range(len(patterns)):  # what an answer leaves open differs from pose to pose
        own = verified_alike(q, s, at[which.reshape(-1) == k])
        out.worst = {w: max(v, out.worst.get(w, 0.0)) for w, v in own.worst.items()}
        out.bad |= own.bad
        out.undecided += own.undecided
    return out


def verified_alike(whole: Question, s: sm.Solution, at: Array) -> Verdict:
    """The same for poses (k,) > 0 of which the answer leaves the same joints open."""
    q, d, size = whole.of(at), in_charts(whole.machine), whole.size
    names, wrench = s.coordinate_names, whole.load["wrench"][at]
    command = {n: q.before[n] for n in s.actuators}
    gravity = np.asarray(q.load["gravity"], dtype=float)
    still = np.broadcast_to(np.eye(3), (len(at), 3, 3))
    case = Case(command, still, wrench[:, :3], wrench[:, 3:], gravity, str(q.load["load_type"]), q.before)
    gap, tip = closed(d, q.before, case, size)
    left_open = tuple(n for n, i in s.joint_index.items() if s.indeterminate_mask[at, i].all())
    at_points = {n: np.array(w[:3], dtype=float) for n, w in q.load.get("wrenches", {}).items()}
    case = replace(
        case, turned=tip.r, smooth=without_friction(q, names), left_open=left_open, at_points=at_points
    )
    found = balance(d, coordinates(names, s.coordinates[at]), case, size)
    stated = s.displacement[at]
    turn = Rotation.from_matrix(found.rotation @ np.swapaxes(tip.r, 1, 2)).as_rotvec()
    off = np.hstack([found.position - tip.p, size * turn]) - stated * [1, 1, 1, size, size, size]
    force = found.residual / np.maximum(found.scale, 1.0)
    undecided = (found.undecided | (found.residual < found.noise)) & ~(force < FORCE)
    errors = {
        "command": np.maximum(gap, task_error(q, command, tip.p)) / size,
        "closure": found.gap / size,
        "force": np.where(undecided, 0.0, force),
        "motion": np.abs(off).max(1) / size,
    }
    out = Verdict({w: float(e.max()) for w, e in errors.items()}, {}, int(undecided.sum()))
    for word, error in errors.items():
        for i in np.flatnonzero(~(error < LIMITS[word])):
            out.bad[int(at[i])] = f"{word} off by {error[i]:.1e}"
    return out


def in_charts(machine: sm.Machine) -> MachineDescription:
    """The description, its free balls about the axes that number their rotations in a solution."""
    d, compiled = machine.description, machine.compiled
    if not compiled.spun_balls and not any(locks(leg.elements) for leg in d.legs):
        return d
    home = dict(zip(compiled.names.coordinates, map(float, compiled.home_coordinates()), strict=True))
    return placed(d, home, home, d.home, compiled.spun_balls)


def locks(elements: Sequence[Any]) -> bool:
    """A free ball that may have been given other axes than it is declared with."""
    for e in elements:
        if isinstance(e, Block) and any(locks(b.elements) for b in e.branches):
            return True
        if isinstance(e, Joint) and e.kind == "spherical" and e.free:
            return True
    return False


def task_error(q: Question, command: dict[str, Array], reached: Array) -> Array:
    """Distance (n,) m of the closed TCP from the command, or of the drives from theirs, in what is commanded."""
    if q.joints:
        return np.asarray(np.abs(np.column_stack([*command.values()]) - q.at).max(1, initial=0.0))
    use = [c in q.machine.description.task for c in "xyz"]
    return np.asarray(np.abs(reached - q.at)[:, use].max(1, initial=0.0))


def without_friction(q: Question, names: Sequence[str]) -> dict[str, Array]:
    """Way (n,) of each coordinate in linear statics without friction, NaN where it is second order; empty where
    nothing rubs."""
    smooth = smoothed(q.machine.description)
    if smooth == q.machine.description:
        return {}
    machine = sm.Machine(smooth)

    def reached(share: float) -> Array:
        gravity = share * np.asarray(q.load["gravity"])
        return q.solve(machine, wrench=share * q.load["wrench"], gravity=list(gravity)).coordinates

    start, step = reached(0.0), 1e-4
    linear, whole = (reached(step) - start) / step, reached(1.0) - start
    bent = np.where(np.sign(linear) == np.sign(whole), 0.01, 1.0) * np.abs(whole - linear)
    doubtful = ~(np.abs(linear) > np.maximum(3e-11, bent))
    return coordinates(names, np.where(doubtful, np.nan, linear))


def smoothed(item: Any) -> Any:
    """A description whose laws have no friction."""
    if isinstance(item, Law):
        return replace(item, friction=0.0)
    if isinstance(item, Joint):
        item = replace(item, friction=None)
    if isinstance(item, tuple):
        return tuple(smoothed(v) for v in item)
    if is_dataclass(item) and not isinstance(item, type):
        return replace(item, **{f.name: smoothed(getattr(item, f.name)) for f in fields(item) if f.init})
    return item

"""Motions that every row of a plan would show a perfect instrument."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import (
    carrier,
    coordinates_of,
    in_reach,
    point_positions,
    positions_of,
    rigged,
    targets,
)
from stiffmap.experiment.prediction.joints import is_sided, joint_channels, joint_motions, lagging, signs
from stiffmap.experiment.readings import Seen, kind_of
from stiffmap.model.description.alike import rests_at_command
from stiffmap.solve.closing import of_drives
from stiffmap.solve.machine import Machine, solve_with
from stiffmap.solve.options import SolveOptions
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call, solve_joints
from stiffmap.solve.status import Flag, Status

ACROSS = 1e-3
"""Share of the work that a load does along a free motion of play below which it does not press the gap."""


def motions(machine: Machine, plan: Experiment, threads: int | None = None) -> tuple[Floats, int]:
    """(n, c) m, rad of every row and channel, and how many equilibria were solved for it.

    Deflection: the loaded minus the unloaded state of the same commanded pose.
    """
    if plan.gravity_of is not None:
        return _in_parts(plan, plan.gravity_of, partial(_under_gravity, machine, threads))
    if any(kind_of(c) for c in plan.extra):
        return _with_kinds(machine, plan, threads)
    machine = rigged(machine, plan.loop)
    if plan.quantity == "position":
        return (_equilibria if plan.wrench.any() else _at_rest)(machine, plan, threads)
    out, count = _equilibria(machine, plan, threads)
    rest, more = _at_rest(machine, plan, threads)
    return out - rest, count + more


def _in_parts(
    plan: Experiment, labels: Any, solve: Callable[[Experiment, Any], tuple[Floats, int]]
) -> tuple[Floats, int]:
    """(n, c) of what is solved apart for the rows of each label (n,) or (n, ...), and how many equilibria that took."""
    each, number = np.unique(labels, axis=0, return_inverse=True)
    out, count = np.full((len(plan), len(plan.channels)), np.nan), 0
    for k, label in enumerate(each):
        here = np.flatnonzero(number.reshape(-1) == k)
        out[here], more = solve(plan.rows(here), label)
        count += more
    return out, count


def _under_gravity(
    machine: Machine, threads: int | None, plan: Experiment, gravity: Floats
) -> tuple[Floats, int]:
    x, y, z = gravity.tolist()
    return motions(machine, replace(plan, gravity=(x, y, z), gravity_of=None), threads)


def _with_kinds(machine: Machine, plan: Experiment, threads: int | None) -> tuple[Floats, int]:
    """The motions of the point that is read, and what the kinds of readings make of them."""
    plain = tuple(c for c in plan.extra if kind_of(c) is None)
    bare = replace(plan, extra=plain, other=None, other_joints=None)
    motion, count = motions(machine, bare, threads)
    out = np.full((len(plan), len(plan.channels)), np.nan)
    out[:, [plan.channels.index(c) for c in bare.channels]] = motion
    here = Seen(bare, motion[:, :6], positions_of(machine, bare))
    kinds = [(i, kind) for i, c in enumerate(plan.channels) if (kind := kind_of(c))]
    for i, kind in kinds:
        if not kind.pair:
            out[:, i] = kind.change(here, None)
    paired = [(i, kind) for i, kind in kinds if kind.pair]
    if not paired or plan.other is None or not np.isfinite(plan.other).all(axis=1).any():
        return out, count
    rows = np.flatnonzero(np.isfinite(plan.other).all(axis=1))
    second = replace(
        bare,
        position=plan.other,
        rotation=plan.other_rotation,
        command=plan.other_command,
        joints=plan.other_joints,
        near=None,
    ).rows(rows)
    there, more = motions(machine, second, threads)
    first = bare.rows(rows)
    start = Seen(first, motion[rows, :6], here.position[rows])
    end = Seen(second, there[:, :6], positions_of(machine, second))
    for i, kind in paired:
        out[rows, i] = kind.change(start, end)
    return out, count + more


def _at_rest(machine: Machine, plan: Experiment, threads: int | None) -> tuple[Floats, int]:
    """(n, c) without the wrenches: in the centre of every gap, or on the side of the approach."""
    bare = plan.without_load
    if not is_sided(machine.description, plan):
        return _equilibria(machine, bare, threads)
    behind = partial(lagging, machine, weighs=bool(plan.gravity))
    return _in_parts(bare, signs(machine, bare), lambda part, side: _equilibria(behind(side), part, threads))


def _equilibria(machine: Machine, plan: Experiment, threads: int | None) -> tuple[Floats, int]:
    """(n, c) under the wrenches of the plan; where nothing moves the machine, zero at poses that can be reached."""
    if not plan.wrench.any() and not moves_unloaded(machine, plan):
        there = in_reach(machine, plan.each_pose)[plan.groups]
        return np.where(there[:, None], np.zeros((len(plan), len(plan.channels))), np.nan), 0
    if len(set(plan.load_points)) < 2:
        return _unique(machine, threads, plan, plan.load_points[0] if plan.load_points else plan.load_point)
    return _in_parts(plan, plan.load_points, partial(_unique, machine, threads))


def _unique(machine: Machine, threads: int | None, plan: Experiment, load_point: str) -> tuple[Floats, int]:
    """Each different (pose, wrench) is solved once."""
    once, back = plan.distinct
    read = targets(machine, plan)
    on = carrier(machine, plan.loop.instrument_on)
    wanted = list(dict.fromkeys([*read, *([on] if on else [])]))
    against = carrier(machine, plan.loop.force_against)
    options = SolveOptions(
        point=str(load_point),
        wrenches=_reaction(machine, once, load_point, against) if against else {},
        read_points=wanted,
        gravity=once.gravity,
        stiffness=bool(joint_channels(plan)),
        threads=threads,
    )
    solution = solved(machine, once, options)
    ok = solution.ok | _in_play(solution, once)
    moved = np.where(ok[:, None, None], solution.readings[:, 1:], np.nan)
    number = {point: i for i, point in enumerate(wanted)}
    linear = moved[back, [number[r] for r in read]]
    if on:
        linear = seen_from(machine, plan, on, linear, moved[back, number[on]])
    if not joint_channels(plan):
        return linear, len(once)
    joints = joint_motions(machine, once, solution.coordinates, solution.coordinate_names)
    joints = np.where(ok[:, None], joints, np.nan)
    return np.hstack([linear, joints[back]]), len(once)


def solved(machine: Machine, plan: Experiment, options: SolveOptions) -> Solution:
    """Each row at its pose, or at its joints in the branch in which they are commanded."""
    if plan.joints is None:
        known = plan.near is not None and tuple(machine.compiled.names.coordinates) == plan.near_names
        start = plan.near if known else None
        options = replace(options, rotation=plan.rotation, start=start)
        return solve_with(machine, plan.position, plan.wrench, options)
    start = coordinates_of(machine, plan)
    call = Call(machine.description.home.p, plan.wrench, replace(options, start=start))
    return solve_joints(machine.compiled, of_drives(machine.compiled, start), call)


def _in_play(solution: Solution, plan: Experiment) -> Mask:
    """Rows where nothing but play is loose and no load lies across it: any place within a gap is an equilibrium, and friction
    or what came before holds it; the drives stand in the middle of their gaps.

    A twist that play leaves free takes no work of the load, up to `ACROSS` of what the load would do along its own
    motion: second-order forces do not overcome friction.
    """
    loose = (solution.status == Status.SINGULAR) & (solution.flags & Flag.FREE_PLAY > 0)
    out = loose & ~plan.wrench.any(axis=1)
    asked = np.flatnonzero(loose & ~out)
    if not asked.size:
        return np.asarray(out)
    twists, load = np.nan_to_num(solution.free_twists[asked]), plan.wrench[asked]
    work = np.abs(np.einsum("ni,nij->nj", load, twists))
    parts = (slice(0, 3), slice(3, 6))
    most = sum(
        np.linalg.norm(load[:, p], axis=1)[:, None] * np.linalg.norm(twists[:, p], axis=1) for p in parts
    )
    still = np.isfinite(solution.displacement[asked]).all(axis=1)
    out[asked] = still & (work <= ACROSS * most + np.finfo(float).tiny).all(axis=1)
    return np.asarray(out)


def _reaction(machine: Machine, plan: Experiment, load_point: str, against: str) -> dict[str, Floats]:
    """The opposite of the wrench on the body that takes it, about that body's point."""
    arm = point_positions(machine, load_point, plan) - point_positions(machine, against, plan)
    force, moment = plan.wrench[:, :3], plan.wrench[:, 3:]
    return {against: -np.hstack([force, moment + np.cross(arm, force)])}


def seen_from(machine: Machine, plan: Experiment, on: str, motion: Floats, carrier_motion: Floats) -> Floats:
    """(n, 6) motion of the points read, in the axes of the body that carries the instrument."""
    origin = point_positions(machine, on, plan)
    arm = positions_of(machine, plan) - origin
    turn = Rotation.from_rotvec(np.nan_to_num(carrier_motion[:, 3:]))
    linear = turn.inv().apply(arm + motion[:, :3] - carrier_motion[:, :3]) - arm
    angular = (turn.inv() * Rotation.from_rotvec(np.nan_to_num(motion[:, 3:]))).as_rotvec()
    return np.where(np.isfinite(motion), np.hstack([linear, angular]), np.nan)


def moves_unloaded(machine: Machine, plan: Experiment) -> bool:
    """Without load only errors, preload or weight move a machine from its command."""
    d = machine.description
    return bool(plan.gravity or d.gravity) or not rests_at_command(d)

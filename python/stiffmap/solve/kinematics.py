"""Kinematics by closure, springs at rest: poses and coordinates, how far a machine goes from a pose towards another, and in which ways
it takes one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import TASK
from stiffmap.solve.closing import Kinematics as Kinematics, Start, close_actuators, close_poses
from stiffmap.solve.compiled import Role, Status
from stiffmap.solve.machine import Machine, hint_metres, takes_machine

SAME = 1e-7
"""m, rad: poses that differ by less are one."""
BRANCHES_TRIED, ALIKE = 96, 1e-4
"""Starts of the search for assembly modes; rad or m by which two of them differ."""
SLICES, ROUNDS = 9, 3
"""The way is cut in slices, the first bad one again: 8³ steps of it."""
SLACK = 1e-9


@takes_machine
def inverse_kinematics(
    machine: Machine,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    start: Start | None = None,
    threads: int | None = None,
) -> Kinematics:
    """Actuator and passive coordinates at commanded TCP poses, on the declared assembly branch.

    position (..., 3) m; rotation (..., 3, 3), None: as at home. start: joint coordinates on another branch
    (docs/conventions.md), which are closed with their actuators held and continued to the pose; None: from
    home. docs/theory.md (C3), (C5).
    """
    out = close_poses(machine.compiled, position, rotation, start, threads)
    hint_metres(machine, position, bool((out.status == Status.UNREACHABLE).all()))
    return out


@takes_machine
def forward_kinematics(
    machine: Machine, actuators: ArrayLike, *, start: Start | None = None, threads: int | None = None
) -> Kinematics:
    """TCP pose at actuator coordinates (..., actuators) m or rad, by continuation from home or from `start`.

    It is where the declared geometry puts the TCP, which is what a controller knows. Effects on the geometry, such as those that
    `calibrate` writes into a machine file, do not enter: where the machine really stands is this pose moved by
    `machine.solve_joints(actuators).displacement` (no load; TCP translation m, rotation vector rad, base axes).
    """
    return close_actuators(machine.compiled, actuators, start, threads)


def missed(
    machine: Machine, position: Floats, rotation: Floats | None = None, threads: int | None = None
) -> Floats:
    """(..., 6) m, rad: the pose that the machine takes without load less the one that is asked for; rx, ry, rz about the tool's
    axes, 0 where no rotation (..., 3, 3) is asked for. A machine that does not command all of a pose reaches any by its status.
    """
    shape = np.broadcast_shapes(position.shape[:-1], () if rotation is None else rotation.shape[:-2])
    gap = np.zeros((*shape, 6))
    if set(TASK) - set(machine.description.task):
        at = inverse_kinematics(machine, position, rotation, threads=threads)
        gap[..., :3] = at.position - position
        if rotation is not None:
            turn = np.swapaxes(rotation, -1, -2) @ np.nan_to_num(at.rotation)
            turn[np.isnan(at.rotation).any(axis=(-1, -2))] = np.eye(3)
            gap[..., 3:] = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*shape, 3)
    return gap


def missed_words(machine: Machine, gap: Floats) -> str:
    """``y, z by up to 3 mm (swing-table commands x)``: the directions in which poses (..., 6) m, rad are missed; empty where none is."""
    most = np.nanmax(np.abs(gap.reshape(-1, 6)), axis=0, initial=0.0)
    found = [
        f"{axis} by up to {1e3 * v:.4g} mm" if len(axis) == 1 else f"{axis} by up to {np.degrees(v):.4g} deg"
        for axis, v in zip(TASK, most, strict=True)
        if v > SAME
    ]
    return f"{', '.join(found)} (it commands {', '.join(machine.description.task)})" if found else ""


def must_take(machine: Machine, position: Floats, rotation: Floats | None = None) -> None:
    """Raise StiffmapError where others than the wanted poses (n, 3) m, (n, 3, 3) are taken; a coordinate that is not commanded and as
    at home is not asked for."""
    home, task = machine.description.home, machine.description.task
    asked = np.zeros((len(position), 6))
    asked[:, :3] = position - home.p
    if rotation is not None:
        turn = home.r.T @ rotation
        turn[~np.isfinite(turn).all(axis=(-1, -2))] = np.eye(3)
        asked[:, 3:] = Rotation.from_matrix(turn).as_rotvec()
    still = np.array([axis not in task for axis in TASK]) & (np.abs(asked) <= SAME)
    gap = np.where(still, 0.0, missed(machine, position, rotation))
    words = missed_words(machine, gap)
    if words:
        first = int(np.argmax((np.abs(gap) > SAME).any(axis=1)))
        raise StiffmapError(
            f"{machine.name} cannot take the wanted poses: it misses {words}; the first is row {first + 1}"
        )


def follow(
    machine: Machine, start: tuple[Floats, Floats], wanted: tuple[Floats, Floats], mode: Floats | None = None
) -> tuple[Floats, Floats, str]:
    """Straight from a pose that the machine takes (position m, rotation (3, 3)) towards a wanted one: where it comes to, and a
    sentence about what stops it, empty where nothing does.

    The pose asked for is taken at once where it is good; else the last good one on the way is.
    """
    reason = why_not(machine, inverse_kinematics(machine, *wanted, start=mode, threads=1))[0]
    if not reason:
        return *wanted, ""
    low, high = 0.0, 1.0
    way = wanted[0] - start[0]
    turn = Slerp([0, 1], Rotation.from_matrix(np.array([start[1], wanted[1]])))
    for _ in range(ROUNDS):
        share = np.linspace(low, high, SLICES)
        p = start[0] + share[:, None] * way
        k = inverse_kinematics(machine, p, turn(share).as_matrix(), start=mode, threads=1)
        reasons = why_not(machine, k)
        bad = next((i for i, text in enumerate(reasons) if text and i > 0), None)
        if bad is None:
            break
        reason, low, high = reasons[bad], float(share[bad - 1]), float(share[bad])
    return start[0] + low * way, turn(low).as_matrix(), f"stopped: {reason}"


def why_not(machine: Machine, k: Kinematics) -> list[str]:
    """Of each pose: which limit it breaks, or that it cannot be reached; empty where it is good."""
    names = machine.compiled.names
    joints = [i for i, role in enumerate(names.roles) if role != Role.SPRING]
    low, high = np.array(machine.compiled.core.limits).reshape(-1, 2)[joints].T
    coordinates = np.atleast_2d(k.coordinates)[:, joints]
    slack = SLACK * np.maximum(1.0, np.abs(coordinates))
    broken = (coordinates < low - slack) | (coordinates > high + slack)
    out = []
    for x, over, status in zip(coordinates, broken, np.atleast_1d(k.status), strict=True):
        if status != Status.CONVERGED:
            out.append("the machine cannot reach further")
        elif not over.any():
            out.append("")
        else:
            i = int(over.argmax())
            name, limit = names.coordinates[joints[i]], low[i] if x[i] < low[i] else high[i]
            sliding = names.is_prismatic(name)
            shown = f"{1e3 * limit:.4g} mm" if sliding else f"{np.rad2deg(limit):.4g} deg"
            out.append(f"{name} is at its limit, {shown}")
    return out


def assembly_modes(
    machine: Machine, position: ArrayLike, rotation: ArrayLike | None = None
) -> list[tuple[float, ...]]:
    """All coordinates of the ways to take a pose (m; (3, 3), None: as at home) that a search from random joints finds, that of home
    first."""
    core, names = machine.compiled, machine.compiled.names
    rng = np.random.default_rng(0)
    starts = np.tile(core.home_coordinates(), (BRANCHES_TRIED, 1))
    for name, i in names.joints.items():
        spread = 0.5 * core.length if names.is_prismatic(name) else np.pi
        starts[1:, i] += rng.uniform(-spread, spread, BRANCHES_TRIED - 1)
    k = inverse_kinematics(machine, position, rotation, start=starts)
    found: list[Floats] = []
    drives = [names.joints[a] for a in names.actuators]
    angular = np.array([not names.is_prismatic(a) for a in names.actuators])
    for x in k.coordinates[np.asarray(k.status) == Status.CONVERGED]:
        off = [_difference(x[drives], y[drives], angular) for y in found]
        if all(o > ALIKE for o in off):
            found.append(x)
    return [tuple(map(float, x)) for x in found]


def _difference(a: Floats, b: Floats, angular: Floats) -> float:
    d = a - b
    turned = np.where(angular, (d + np.pi) % (2 * np.pi) - np.pi, d)
    return float(np.abs(turned).max(initial=0.0))

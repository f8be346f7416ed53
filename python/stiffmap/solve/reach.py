"""How far a machine goes from a pose towards another, and in which ways it takes one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.closing import Kinematics
from stiffmap.solve.compiled import Role, Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

BRANCHES_TRIED, ALIKE = 96, 1e-4
"""Starts of the search for assembly modes; rad or m by which two of them differ."""
SLICES, ROUNDS = 9, 3
"""The way is cut in slices, the first bad one again: 8³ steps of it."""
SLACK = 1e-9


def follow(
    machine: Machine,
    start: tuple[Floats, Floats],
    wanted: tuple[Floats, Floats],
    mode: Floats | None = None,
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
        reasons = why_not(
            machine, inverse_kinematics(machine, p, turn(share).as_matrix(), start=mode, threads=1)
        )
        bad = next((i for i, text in enumerate(reasons) if text and i > 0), None)
        if bad is None:
            break
        reason, low, high = reasons[bad], float(share[bad - 1]), float(share[bad])
    return start[0] + low * way, turn(low).as_matrix(), f"stopped: {reason}"


def why_not(machine: Machine, k: Kinematics) -> list[str]:
    """Of each pose: which limit it breaks, or that it cannot be reached; empty where it is good."""
    names = machine.compiled.names
    joints = [i for i, role in enumerate(names.roles) if role != Role.SPRING]
    low, high = np.array(machine.compiled.limits).reshape(-1, 2)[joints].T
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

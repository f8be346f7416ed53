"""How far the tool can follow a hand: closure by kinematics, stopped at limits, which are named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.closing import Kinematics
from stiffmap.solve.compiled import Role, Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine

SLICES, ROUNDS = 9, 3
"""The way is cut in slices, the first bad one again: 8³ steps of it."""
SLACK = 1e-9
UNLIMITED = 1e299


@dataclass(frozen=True, eq=False)
class Reached:
    """Where the tool came to on its way to a wanted pose."""

    position: Floats
    rotation: Floats
    """(3, 3)."""
    share: float
    """Of the way; 1: all of it."""
    stopped_by: str
    """A sentence; empty where nothing did."""


def follow(
    machine: Machine,
    start: tuple[Floats, Floats],
    wanted: tuple[Floats, Floats],
    mode: Floats | None = None,
) -> Reached:
    """Straight from a pose that the machine takes (position m, rotation (3, 3)) towards a wanted one.

    The pose asked for is taken at once where it is good; else the last good one on the way is.
    """
    k = inverse_kinematics(machine, wanted[0], wanted[1], start=mode, threads=1)
    if not why_not(machine, k)[0]:
        return Reached(wanted[0], wanted[1], 1.0, "")
    low, high = 0.0, 1.0
    reason = why_not(machine, k)[0]
    turn = Slerp([0, 1], Rotation.from_matrix(np.array([start[1], wanted[1]])))
    for _ in range(ROUNDS):
        share = np.linspace(low, high, SLICES)
        p = start[0] + share[:, None] * (np.asarray(wanted[0]) - start[0])
        k = inverse_kinematics(machine, p, turn(share).as_matrix(), start=mode, threads=1)
        reasons = why_not(machine, k)
        bad = [i for i, text in enumerate(reasons) if text and i > 0]
        if not bad:
            break
        reason = reasons[bad[0]]
        low, high = float(share[bad[0] - 1]), float(share[bad[0]])
    return Reached(
        start[0] + low * (np.asarray(wanted[0]) - start[0]), turn(low).as_matrix(), low, f"stopped: {reason}"
    )


def why_not(machine: Machine, k: Kinematics) -> list[str]:
    """Of each pose: which limit it breaks, or that it cannot be reached; empty where it is good."""
    names = machine.compiled.names
    limits = np.array(machine.compiled.limits).reshape(-1, 2)
    x = np.atleast_2d(k.coordinates)
    status = np.atleast_1d(k.status)
    out = []
    for row, how in zip(x, status, strict=True):
        if how != Status.CONVERGED:
            out.append("the machine cannot reach further")
            continue
        broken = [
            (i, end)
            for i, role in enumerate(names.roles)
            if role != Role.SPRING
            for end in _broken(row[i], limits[i])
        ]
        out.append("" if not broken else _words(names.coordinates[broken[0][0]], broken[0][1], machine))
    return out


def _broken(value: float, limits: Floats) -> list[float]:
    slack = SLACK * max(1.0, abs(value))
    if limits[0] > -UNLIMITED and value < limits[0] - slack:
        return [float(limits[0])]
    if limits[1] < UNLIMITED and value > limits[1] + slack:
        return [float(limits[1])]
    return []


def _words(name: str, limit: float, machine: Machine) -> str:
    if machine.compiled.names.is_prismatic(name):
        return f"{name} is at its limit, {1e3 * limit:.4g} mm"
    return f"{name} is at its limit, {np.rad2deg(limit):.4g} deg"

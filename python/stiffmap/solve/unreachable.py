"""Why a pose cannot be reached: which leg ends short of it, and by how much."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import TASK
from stiffmap.model.description.tree import joints
from stiffmap.solve.compiled import CompiledMachine, Role, Status
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine, takes_machine

TURNING, LOOPS = 1e2, 1e5
"""Weights of the orientation and of closed loops inside a leg, over that of the position."""
ENOUGH, TURNED = 1e-6, 2e-4
"""Of the machine's length, and rad: below them a leg reaches the pose (where it ends short, the weight of the orientation leaves
1e-5 rad)."""
HALVINGS = 20


@dataclass(frozen=True)
class Shortfall:
    """How far a leg alone, its joints free of limits, ends from a commanded pose; the orientation comes first."""

    leg: str
    """Its name; empty: all legs together."""
    translation: float
    """m."""
    rotation: float
    """rad."""


@takes_machine
def shortfalls(machine: Machine, position: ArrayLike, rotation: ArrayLike | None = None) -> list[Shortfall]:
    """Legs that cannot reach a commanded TCP pose, springs at rest, the worst first.

    position (3,) m, rotation (3, 3), None: as at home; base axes, task components alone. One entry without a name where
    each leg reaches it alone and not all together; none where they do. Raises StiffmapError for what is no pose.
    """
    p = real_array(position, "position")
    r = real_array(machine.compiled.home_rotation if rotation is None else rotation, "rotation")
    if p.shape != (3,) or r.shape != (3, 3) or not (np.isfinite(p).all() and np.isfinite(r).all()):
        raise StiffmapError(
            f"expected a position of 3 finite numbers and a rotation (3, 3), got {position!r}, {rotation!r}"
        )
    d = machine.description
    alone = {g.name: replace(d, legs=(g,), external_springs=(), effects=()) for g in d.legs}
    found = [_least(CompiledMachine(one), name, p, r) for name, one in alone.items()]
    short = [s for s in found if _is_short(s, machine)]
    if not short and len(found) != 1:
        short = [s for s in (_least(machine.compiled, "", p, r),) if _is_short(s, machine)]
    length = machine.compiled.length
    return sorted(short, key=lambda s: -round(s.translation / length + s.rotation, 6))


@takes_machine
def why_unreachable(machine: Machine, position: ArrayLike, rotation: ArrayLike | None = None) -> str:
    """Why a commanded TCP pose cannot be reached, in words, mm and deg: ``leg x ends 125 mm short of it``.

    position (3,) m, rotation (3, 3), None: as at home; base axes, springs at rest. A leg alone is judged by its lengths; where
    all legs reach the pose, drives and joints out of their ranges are named (docs/theory.md C3). A pose that can be reached is said
    to be so.
    """
    p = real_array(position, "position")
    if not (
        np.isfinite(p).all() and (rotation is None or np.isfinite(real_array(rotation, "rotation")).all())
    ):
        return "the commanded pose holds what is not a number"
    short = shortfalls(machine, p, rotation)
    if not short:
        return _within_lengths(machine, p, rotation)
    alike: dict[str, list[str]] = {}
    for s in short:
        alike.setdefault(_gap(s, machine.compiled.length), []).append(s.leg)
    said = [f"{_who(legs, machine)} {gap}" for gap, legs in alike.items()]
    others = [leg for leg in machine.legs if leg not in {s.leg for s in short}]
    if short[0].leg and others:
        said.append(f"leg{'s' if len(others) > 1 else ''} {', '.join(others)} would reach it")
    return "; ".join(said)


def _within_lengths(machine: Machine, p: Floats, rotation: ArrayLike | None) -> str:
    """The reason where the lengths of all legs allow the pose."""
    k = inverse_kinematics(machine, p, rotation)
    if int(k.status) == Status.CONVERGED:
        return "; ".join(_beyond(machine, k.coordinates)) or "nothing is in the way: the pose can be reached"
    if int(k.status) == Status.SINGULAR:
        return "every leg reaches it, but the machine is singular there"
    return (
        "every leg reaches it, but no continuous motion from the home configuration does: it lies behind a singular pose, or "
        "in another assembly mode (start=)"
    )


def _beyond(machine: Machine, coordinates: Floats) -> list[str]:
    """Joints and drives that would stand outside of their ranges."""
    out, named = [], joints(machine.description)
    for name, value in zip(machine.compiled.names.coordinates, coordinates, strict=True):
        joint = named.get(name)
        ends = None if joint is None else joint.ends
        if joint is None or ends is None or ends[0] <= value <= ends[1]:
            continue
        unit, factor = ("mm", 1e3) if joint.kind == "prismatic" else ("deg", float(np.rad2deg(1.0)))
        low, at, high = (f"{factor * v:.4g}" for v in (ends[0], float(value), ends[1]))
        out.append(f"{name} would stand at {at} {unit}, its range is {low} to {high} {unit}")
    return out


def _who(legs: list[str], machine: Machine) -> str:
    if not legs[0]:
        together = "each leg reaches it alone; all together they end"
        return together if len(machine.legs) > 1 else "the machine ends"
    if len(legs) == 1:
        return f"leg {legs[0]} ends"
    return f"legs {', '.join(n for n in machine.legs if n in legs)} end"


def _gap(s: Shortfall, length: float) -> str:
    # far out, the weights leave an angle in proportion to the distance, which is none that the pose asks for
    far = max(1.0, s.translation / length)
    if s.rotation > TURNED * far:  # where it would be if it could turn so is idle
        return f"{np.rad2deg(s.rotation):.4g} deg off the orientation"
    return f"{1e3 * s.translation:.4g} mm short of it"


def _is_short(s: Shortfall, machine: Machine) -> bool:
    return s.translation > ENOUGH * machine.compiled.length or s.rotation > TURNED


def _least(core: CompiledMachine, name: str, p: Floats, r: Floats) -> Shortfall:
    """The smallest gap between the TCP that the joints carry and a pose, from starts on the way there."""
    mask = np.array([c in core.description.task for c in TASK])
    roles = core.names.roles
    free = [i for i, role in enumerate(roles) if role in (Role.ACTUATOR, Role.PASSIVE)]
    prismatic = np.array([core.names.prismatic[i] for i in free], dtype=bool)
    units = np.where(prismatic, core.length, 1.0)

    def gap(x: Floats) -> tuple[Floats, Floats]:
        positions, rotations = core.frames(x)
        turn = Rotation.from_matrix(r @ rotations[-1].T).as_rotvec()
        loops = [
            np.r_[
                (positions[a] - positions[b]) / core.length,
                Rotation.from_matrix(rotations[a] @ rotations[b].T).as_rotvec(),
            ]
            for _, _, a, b in core.loops
        ]
        return np.where(mask, np.r_[p - positions[-1], turn], 0.0), np.concatenate([np.zeros(0), *loops])

    def moved(u: Floats, start: Floats) -> Floats:
        x = start.copy()
        x[free] += u * units
        return x

    def weighted(u: Floats, start: Floats) -> Floats:
        pose, loops = gap(moved(u, start))
        return np.concatenate([pose[:3] / core.length, TURNING * pose[3:], LOOPS * loops])

    tried = []
    for start in _starts(core, p, r):
        fit = least_squares(
            weighted, np.zeros(len(free)), args=(start,), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200
        )
        pose, _ = gap(moved(fit.x, start))
        tried.append(Shortfall(name, float(np.linalg.norm(pose[:3])), float(np.linalg.norm(pose[3:]))))
    return min(
        tried, key=lambda s: s.translation / core.length + s.rotation, default=Shortfall(name, 0.0, 0.0)
    )


def _starts(core: CompiledMachine, p: Floats, r: Floats) -> list[Floats]:
    """Home, and the last configuration that closes on the straight way from there; none where the pose itself closes."""
    home = core.description.home
    way = Rotation.from_matrix(r @ home.r.T).as_rotvec()

    def closed(t: float) -> Floats | None:
        turned = Rotation.from_rotvec(t * way).as_matrix() @ home.r
        closure = core.close_poses((home.p + t * (p - home.p))[None], turned[None], 1, None)
        found: Floats = closure[0][0]
        return found if closure[3][0] == Status.CONVERGED else None

    if closed(1.0) is not None:
        return []
    low, high, last = 0.0, 1.0, core.home_coordinates()
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        x = closed(middle)
        low, high = (low, middle) if x is None else (middle, high)
        last = last if x is None else x
    return [core.home_coordinates(), last]

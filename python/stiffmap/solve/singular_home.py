"""Directions in which a serial machine cannot move at home, and the joints that are the cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.model.description import TASK, Body, Joint, Offset, Point, Spring
from stiffmap.solve.compiled import CompiledMachine, Role

SINGULAR, NEAR = 1e-6, 0.03
"""Of the largest singular value: below the first nothing moves that way, below the second steps soon fail."""
BENT = 0.5  # rad
IN_LINE = 1e-3  # rad, and of the lever arm


@dataclass(frozen=True)
class Axis:
    """Axis of a drive at home, in base axes: unit vector, and a point of it (m)."""

    name: str
    turns: bool
    along: Floats
    point: Floats


@dataclass(frozen=True)
class SerialHome:
    """One chain of rigid parts and drives at home: its axes and what they do to the tool."""

    axes: list[Axis]
    jacobian: Floats
    """(6, n) m and rad per m or rad of each drive."""

    @property
    def arm(self) -> float:
        """Longest lever arm of the tool about an axis, m: the machine's size, however far away its frames lie. 0: all slide."""
        turning = [k for k, a in enumerate(self.axes) if a.turns]
        return float(np.linalg.norm(self.jacobian[:3, turning], axis=0).max(initial=0.0))

    @property
    def scale(self) -> Floats:
        """(6,) 1/m and 1: what makes translations comparable with rotations."""
        return np.where(np.arange(6) < 3, 1 / (self.arm or 1.0), 1.0)

    def scaled(self, rows: list[int]) -> Floats:
        """Components `rows` of the Jacobian, without units."""
        out: Floats = (self.scale[:, None] * self.jacobian)[rows]
        return out


def serial_home(machine: CompiledMachine, bent: Mapping[str, float] | None = None) -> SerialHome | None:
    """The axes of a machine of one chain whose joints all have drives; None for another.

    bent
        Joint -> what is added to its coordinate at home, m or rad.
    """
    d = machine.description
    elements = (*d.base, *d.legs[0].elements, *d.platform)
    joints = [e for e in elements if type(e) is Joint and e.actuated]
    if len(d.legs) != 1 or any(
        not isinstance(e, Offset | Spring | Body | Point) for e in elements if e not in joints
    ):
        return None
    node = {
        c: i for i, (_, c) in enumerate(machine.nodes) if c >= 0 and machine.names.roles[c] == Role.ACTUATOR
    }
    q = machine.home_coordinates().copy()
    q[[*node]] += [(bent or {}).get(e.name, 0.0) for e in joints]
    position, rotation = machine.frames(q)
    axes = [
        Axis(e.name, e.kind == "revolute", rotation[i] @ np.array(e.axes[0]), position[i])
        for e, i in zip(joints, node.values(), strict=True)
    ]
    columns = [
        np.r_[np.cross(a.along, position[-1] - a.point), a.along] if a.turns else np.r_[a.along, np.zeros(3)]
        for a in axes
    ]
    return SerialHome(axes, np.array(columns).reshape(-1, 6).T)


def singular_words(machine: CompiledMachine, steps_fail: bool) -> str:
    """That home is singular, with the lost directions and the joints to bend; empty where it is not.

    With `steps_fail`, small steps from home having failed, also a home close to a singular one. Only for serial machines
    with a drive for each component of their task.
    """
    home, d = serial_home(machine), machine.description
    rows = [TASK.index(c) for c in d.task]
    if home is None or len(home.axes) < len(rows):
        return ""
    left, sizes, right = np.linalg.svd(home.scaled(rows))
    lost = sizes < (NEAR if steps_fail else SINGULAR) * sizes[0]
    if not lost.any():
        return ""
    names = [TASK[i] for i in rows]
    ways = "; ".join(_twist(v, names) for v in (home.scale[rows, None] * _plain_basis(left[:, lost])).T)
    nearly = "" if sizes[-1] < SINGULAR * sizes[0] else "nearly "
    return (
        f"home is {nearly}singular: the tool cannot move along {ways}{_cause(home, right[len(sizes) - lost.sum() :])}"
        + _remedy(machine, home, rows)
    )


def _plain_basis(vectors: Floats) -> Floats:
    """The same space, each vector with as many zeros as can be: reduced by columns."""
    out = vectors.copy()
    taken: list[int] = []
    for k in range(out.shape[1]):
        free = np.abs(out[:, k])
        free[taken] = 0.0
        row = int(np.argmax(free))
        taken.append(row)
        out[:, k] /= out[row, k]
        others = [j for j in range(out.shape[1]) if j != k]
        out[:, others] -= np.outer(out[:, k], out[row, others])
    return out


def _twist(v: Floats, names: list[str]) -> str:
    """``(y, rz) = (-0.484, 0.875)``; one component by its name."""
    v = v / np.linalg.norm(v)
    v = v * np.sign(v[np.argmax(np.abs(v))])
    seen = [i for i in range(len(v)) if abs(v[i]) > 5e-4]
    if len(seen) == 1:
        return names[seen[0]]
    return f"({', '.join(names[i] for i in seen)}) = ({', '.join(f'{v[i]:.3f}' for i in seen)}) (m, rad)"


def _cause(home: SerialHome, kernel: Floats) -> str:
    """The joints whose axes are in line, or else whose motions add up to none."""
    for a, b in combinations([a for a in home.axes if a.turns], 2):
        off = float(np.linalg.norm(np.cross(b.point - a.point, a.along)))
        if np.linalg.norm(np.cross(a.along, b.along)) < IN_LINE and off < IN_LINE * home.arm:
            return f": the axes of {a.name} and {b.name} are in line"
    if len(home.axes) > home.jacobian.shape[0]:
        return ""
    among = [a.name for a, k in zip(home.axes, kernel.T, strict=True) if np.abs(k).max() > 0.05]
    return f": the motions of {', '.join(among)} add up to none"


def _remedy(machine: CompiledMachine, home: SerialHome, rows: list[int]) -> str:
    """The one or two joints that lead farthest away from the singular home."""
    turning = [a.name for a in home.axes if a.turns]
    for count in (1, 2):
        tried = [
            (_margin(serial_home(machine, dict.fromkeys(few, BENT)), rows), few)
            for few in combinations(turning, count)
        ]
        best, few = max(tried, default=(0.0, ()))
        if best > NEAR / 3:
            return f"; give `home` with {' and '.join(few)} bent, such as by {BENT:g} rad"
    return "; give `home` with other coordinates"


def _margin(home: SerialHome | None, rows: list[int]) -> float:
    """Smallest singular value over the largest."""
    if home is None:
        return 0.0
    sizes = np.linalg.svd(home.scaled(rows), compute_uv=False)
    return float(sizes[-1] / sizes[0])

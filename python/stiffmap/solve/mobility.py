"""Degrees of freedom of a machine at a configuration, counted from its closure equations; motions that nothing holds, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.compiled import Role
from stiffmap.solve.machine import Machine

STEP = 1e-6
RANK = 1e-6
"""Relative size below which a singular value counts as zero; central differences err by about 1e-9."""


@dataclass(frozen=True)
class Mobility:
    """Counts with the drives free to move and all springs rigid."""

    joints: int
    """Elementary joint coordinates."""
    equations: int
    """Closure equations: six for each loop."""
    independent: int
    """Rank of the closure equations."""
    platform: int
    """Independent motions of the platform."""

    @property
    def total(self) -> int:
        """Degrees of freedom of the whole mechanism."""
        return self.joints - self.independent

    @property
    def internal(self) -> int:
        """Motions that leave the platform in place."""
        return self.total - self.platform

    @property
    def overconstraint(self) -> int:
        """Closure equations that follow from the others."""
        return self.equations - self.independent

    def as_plain(self) -> dict[str, int]:
        """Data of JSON."""
        return {
            "degrees_of_freedom": self.total,
            "platform_freedom": self.platform,
            "internal_freedom": self.internal,
            "over_constraint": self.overconstraint,
            "closure_equations": self.equations,
            "joint_coordinates": self.joints,
        }


def mobility(machine: Machine, coordinates: Floats) -> Mobility:
    """Counts at coordinates that close all loops."""
    core = machine.compiled
    free = [i for i, role in enumerate(core.names.roles) if role != Role.SPRING]
    loops = [(primary, end) for _, _, primary, end in core.loops]
    columns = [_rates(machine, coordinates, i, loops) for i in free]
    closure = np.array([c for c, _ in columns]).T.reshape(6 * len(loops), len(free))
    tip = np.array([t for _, t in columns]).T
    motions = null_space(closure, rcond=RANK) if loops else np.eye(len(free))
    platform = rank(tip @ motions, tip)
    return Mobility(len(free), 6 * len(loops), rank(closure, closure), platform)


def rank(matrix: Floats, scale: Floats) -> int:
    """Number of singular values that count relative to the largest one of another matrix."""
    if 0 in matrix.shape:
        return 0
    return int(np.linalg.matrix_rank(matrix, tol=RANK * np.linalg.norm(scale, 2)))


def _rates(machine: Machine, x: Floats, index: int, loops: list[tuple[int, int]]) -> tuple[Floats, Floats]:
    """Rates of the gaps of all loops and of the platform's frame with one coordinate."""
    shift = np.zeros_like(x)
    shift[index] = STEP
    (p1, r1), (p0, r0) = (machine.compiled.frames(x + s) for s in (shift, -shift))
    twist = np.concatenate([p1 - p0, Rotation.from_matrix(r1 @ np.swapaxes(r0, 1, 2)).as_rotvec()], axis=1)
    twist /= 2 * STEP
    return np.array([twist[end] - twist[primary] for primary, end in loops]).ravel(), twist[-1]


NAMES = "xyz"


def twist_words(twist: Floats, length: float) -> str:
    """``turn about z`` or ``move along x`` for a twist (6,), m and rad."""
    v, w = twist[:3], twist[3:]
    if np.linalg.norm(w) * length > 0.1 * np.linalg.norm(v):
        moved = " and shift with it" if np.linalg.norm(v) > 0.1 * np.linalg.norm(w) * length else ""
        return f"turn about {direction(w)}{moved}"
    return f"move along {direction(v)}"


def direction(v: Floats) -> str:
    """An axis by its name, or the vector."""
    u = v / np.linalg.norm(v)
    main = int(np.argmax(np.abs(u)))
    if abs(u[main]) > 0.999:
        return NAMES[main]
    return f"({', '.join(f'{c:.2g}' for c in u)})"


def free_motions(machine: Machine, free_twists: Floats) -> list[str]:
    """The free twists of a singular pose (6, 6), columns, in words."""
    columns = [c for c in free_twists.T if np.isfinite(c).all()]
    return [twist_words(c, machine.compiled.length) for c in columns]

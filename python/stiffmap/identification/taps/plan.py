"""Poses whose frequencies tell most about the springs of a machine (docs/theory.md V9)."""

from __future__ import annotations

from functools import partial

import numpy as np

from stiffmap.common.broadcasting import Floats, whole_number
from stiffmap.common.errors import StiffmapError
from stiffmap.identification.planning.information import exchange, information_of
from stiffmap.identification.taps.fit import in_si
from stiffmap.identification.taps.problem import TapsProblem, causes
from stiffmap.identification.taps.table import TapTest
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.vibration.modes import tip_modes

NOISE = 0.005
"""Relative standard uncertainty of a frequency."""
STEP = 0.1
"""Of an effect, as in its fit; its prior has the standard deviation 1."""
SHOWN = 1e-3
"""Share of the largest motion at the tool from which on a mode counts."""


@takes_machine
def where_to_tap(
    machine: Machine, count: int, *, modes: int = 4, tries: int = 40, default_u: float = 0.05, seed: int = 0
) -> Floats:
    """(count, 3) m: commanded poses to tap, the most informative first.

    Parameters
    ----------
    modes
        Modes that a tap test finds at a pose, lowest first.
    tries
        Poses of the workspace among which they are chosen, drawn by `seed`.
    default_u
        Standard uncertainty of a mass that declares none, relative.

    Raises StiffmapError for bad input, and where fewer poses can be reached.
    """
    wanted, pool = whole_number(count, "count", 1), whole_number(tries, "tries", 1)
    if wanted > pool:
        raise StiffmapError(f"count: expected at most {pool} poses (tries), got {wanted}")
    low, high = machine.workspace
    position = np.random.default_rng(seed).uniform(low, high, (pool, 3))
    taps, pose = _own_modes(machine, position, whole_number(modes, "modes", 1))
    problem = TapsProblem(machine, taps, None, default_u)
    here = problem.residual()
    columns = []
    for c in causes(problem):
        try:
            columns.append((problem.residual([(c, in_si(c.parameters[0], STEP))]) - here) / STEP)
        except StiffmapError:
            continue
    A, J = np.stack(columns, axis=1), problem.slopes[problem.used]
    pose = pose[problem.used[: len(pose)]]
    if len(np.unique(pose)) < wanted:
        raise StiffmapError(
            f"{machine.name}: {len(np.unique(pose))} of {pool} poses can be reached, {wanted} are wanted"
        )
    x = np.hstack([A, J])
    matrices = np.stack([x[pose == k].T @ x[pose == k] for k in range(pool)])
    value = partial(information_of, wanted=A.shape[1], prior=1.0)
    chosen = exchange(matrices, np.zeros_like(matrices[0]), np.unique(pose), wanted, value, 0)
    return np.asarray(position[chosen])


def _own_modes(machine: Machine, position: Floats, count: int) -> tuple[TapTest, np.ndarray]:
    """The table that the declared machine would give, and the pose of each row."""
    found = tip_modes(machine, position, modes=4 * count)
    rows, pose = [], []
    for k, p in enumerate(position):
        b = found.tip[k, :3]
        size = np.linalg.norm(b, axis=0)
        if not np.isfinite(size).all():
            continue
        seen = np.flatnonzero((size > SHOWN * size.max(initial=0.0)) & (found.square[k] > 0))[:count]
        rows += [[*p, found.frequency[k, i], *(b[:, i] / size[i])] for i in seen]
        pose += [k] * len(seen)
    if not rows:
        raise StiffmapError(f"{machine.name}: no pose of the workspace has a mode at the tool")
    r = np.array(rows)
    return TapTest(r[:, :3], r[:, 3], NOISE * r[:, 3], np.full(len(r), np.nan), r[:, 4:]), np.array(pose)

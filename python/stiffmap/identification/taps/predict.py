"""Modes that a machine should show in a tap test, paired with those that were found by direction and frequency (MAC)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.identification.taps.table import TapTest
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.vibration.modes import tip_modes

OCTAVE = 0.35
"""Difference of the logarithms of two frequencies that weighs as much as directions at right angles."""
NEAR = 0.05
"""Difference of the logarithms of two frequencies within which small errors of the machine mix the directions of two modes: together
they then count as one plane of directions, and frequency decides."""
MODES = 16
"""Of a pose, lowest first, among which those that were found are looked for."""
REACH = 1.0
"""Difference of the logarithms of two frequencies within which a row looks for its mode."""
LIKE = 0.7
"""MAC that a measured shape has with one of these modes at least, or it is noise and has no vote."""
MERGED = 0.1
"""Difference of the logarithms of two frequencies within which a band of responses may show two modes as one."""
SHOWN = 0.03
"""Share of the largest motion at the tool from which on a mode can be merged with another."""
SEEN = 1e-6
"""Share of the largest motion at the tool from which on a mode can be seen there."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """For each row of a tap test the mode that it is; NaN where the machine has none left for it."""

    frequency: Floats
    """(n,) Hz."""
    ratio: Floats
    """(n,) damping ratio, declared or assumed."""
    mac: Floats
    """(n,) square of the cosine between the directions; NaN where none was measured."""
    flexibility: Floats
    """(n, 3) m/N, as measured by a hammer; NaN where no hammer is known."""
    voted: NDArray[np.bool_]
    """(n,) whether the measured direction had a vote; not where it is that of no mode near, as noise is."""
    merged: Floats
    """(n,) logarithm by which other modes lie off that this one has near it, where fewer were found there than there are; else 0."""


@takes_machine
@checked
def predict_taps(machine: Machine, taps: TapTest) -> Predicted:
    """Frequencies that the machine should show at the poses of a tap test.

    Modes are paired at each pose so that directions (MAC of the tool's motion) and frequencies agree best together, never by their
    order: modes that cross are kept apart. Raises StiffmapError for bad input.
    """
    once, back = taps.poses
    found = tip_modes(machine, once, modes=MODES)
    f, ratio = np.full(len(taps), np.nan), np.full(len(taps), np.nan)
    mac, flexibility = np.full(len(taps), np.nan), np.full((len(taps), 3), np.nan)
    voted, merged = np.zeros(len(taps), np.bool_), np.zeros(len(taps))
    blow = np.concatenate([taps.hammer, np.cross(taps.lever, taps.hammer)], axis=1)
    for k in range(len(once)):
        rows = np.flatnonzero(back == k)
        b = found.tip[k, :3]
        size = np.linalg.norm(b, axis=0)
        if not np.isfinite(size).all():
            continue
        seen = np.flatnonzero((size > SEEN * size.max(initial=0.0)) & (found.square[k] > 0))
        way, hertz = (b[:, seen] / size[seen]).T, found.frequency[k, seen]
        cosine = (taps.direction[rows] @ way.T) ** 2
        near = np.exp(-0.5 * (np.log(hertz[:, None] / hertz) / NEAR) ** 2)
        alike = np.minimum(1.0, cosine @ near)
        off = np.log(taps.frequency[rows, None] / hertz)
        vote = np.any(np.where(np.abs(off) < REACH, alike, 0.0) > LIKE, axis=1, keepdims=True)
        apart = (off / OCTAVE) ** 2
        mine, theirs = linear_sum_assignment(np.where(vote, 1 - alike, 0.0) + apart)
        f[rows[mine]], ratio[rows[mine]] = hertz[theirs], found.ratio[k, seen[theirs]]
        mac[rows[mine]], voted[rows] = cosine[mine, theirs], vote[:, 0]
        gap = np.abs(np.log(hertz[theirs, None] / hertz))
        gap[:, size[seen] < SHOWN * size.max(initial=0.0)] = np.inf
        close = np.abs(np.log(taps.frequency[rows[mine], None] / taps.frequency[rows])) < MERGED
        fewer = close.sum(axis=1) < (gap < MERGED).sum(axis=1)
        merged[rows[mine]] = np.where(fewer, np.where(gap < MERGED, gap, 0).max(axis=1, initial=0.0), 0)
        b6 = found.tip[k][:, seen[theirs]].T
        flexibility[rows[mine]] = b6[:, :3] * (b6 * blow[rows[mine]]).sum(axis=1, keepdims=True)
    if np.isnan(f).all():
        raise StiffmapError(
            f"{machine.name}: no pose of the tap test can be reached, or none has a mode at the tool"
        )
    return Predicted(f, ratio, mac, flexibility, voted, merged)

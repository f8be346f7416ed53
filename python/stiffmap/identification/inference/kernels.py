"""Covariances of what nobody can name: smooth gaps over the workspace, common errors of a pose, time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.distance import cdist

from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.field import free_position, unit
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.solve.machine import Machine

LENGTHS = (0.6, 2.0)
"""Of the workspace's half: one bend, three bends (Matérn-5/2)."""
SESSIONS = (0.07, 1.0)
"""Correlation times, in sessions."""
FEW_DRIVES = 3
"""Drives up to which the place of the tool says what their coordinates do."""


def gaps(
    machine: Machine, e: Experiment, rows: Integers, channel: Integers, sigma: Floats
) -> Iterator[tuple[str, str, Floats]]:
    """Kind, name and (N, N) covariance in units of the noise, of any scale, of each gap that the readings can hold."""
    same = channel[:, None] == channel
    angle = np.array([c.unit == "rad" for c in e.channels])[channel]
    per = 1.0 / sigma
    load = e.wrench / max(float(np.abs(e.wrench).max(initial=0.0)), 1e-300)
    carried = load[rows] @ load[rows].T
    deflects = e.quantity == "deflection"
    for what, here in (("lengths", ~angle), ("angles", angle)):
        if not here.any():
            continue
        own = same & np.outer(here, here)
        for over, x in _spaces(machine, e):
            distance = cdist(x[rows], x[rows])
            for length in LENGTHS:
                k = own * matern(distance / length) * np.outer(per, per)
                yield "field", f"field of {what} over {over}, {length:g}", k
                if deflects:
                    yield "field", f"compliance of {what} over {over}, {length:g}", k * carried
    yield from shared(e, rows, channel)
    when = e.hours if e.hours is not None else e.order
    if when is not None:
        t, session = _sessions(when, e.runs)
        apart = np.abs(t[rows][:, None] - t[rows])
        together = same & (session[rows][:, None] == session[rows])
        for length in SESSIONS:
            yield "time", f"wander over {length:g} session", together * np.exp(-apart / length)


def shared(e: Experiment, rows: Integers, channel: Integers) -> Iterator[tuple[str, str, Floats]]:
    """What readings of one condition and of one pose share; nothing where that is the noise, or the one before, itself."""
    same = channel[:, None] == channel
    pairs = len(rows)
    for name, of in (("condition", e.conditions[rows]), ("pose", e.groups[rows])):
        own = same & (of[:, None] == of)
        if own.sum() > pairs:
            yield "pose", name, own.astype(float)
            pairs = own.sum()


def matern(distance: Floats) -> Floats:
    """Matérn-5/2 correlation at distances in lengths."""
    a = np.sqrt(5.0) * distance
    return np.asarray((1.0 + a + a * a / 3.0) * np.exp(-a))


def _spaces(machine: Machine, e: Experiment) -> Iterator[tuple[str, Floats]]:
    """(n, k) coordinates in -1 ... 1: of the drives, and of the tool where there are many drives."""
    names = machine.compiled.names.joints
    drives = [names[a] for a in machine.actuators]
    q = coordinates_of(machine, e)[:, drives]
    if np.isfinite(q).all():
        yield "drives", unit(q)
        if len(drives) <= FEW_DRIVES:
            return
    yield "place", unit(free_position(e))


def _sessions(when: Floats, session: Integers) -> tuple[Floats, Integers]:
    """Times in shares of the longest session."""
    longest = max((float(np.ptp(when[session == k])) for k in np.unique(session)), default=0.0)
    return np.asarray(when / (longest or 1.0)), session

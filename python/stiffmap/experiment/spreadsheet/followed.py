"""Places that were seen next to commanded joints: how the joints would have to be read for the machine to go there."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import length_text
from stiffmap.experiment.files.fields import SEEN
from stiffmap.experiment.poses.handeye import FEWEST, places_apart
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.turned import numbered
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine

OFF, CLEAR, BETTER, ALIKE = 0.01, 5.0, 2.0, 3.0
"""Share of the size of the pattern of places beyond which they do not follow the joints; how many times nearer they must be if joints
are read otherwise, and how many times nearer for each joint; how many times larger one pattern is at most that another one may be."""
MOST, CHANGES = 60, 3
"""Rows by which ways of reading are compared, and joints that are read otherwise, at most."""


def followed(m: Meant, machine: Callable[[], Machine]) -> None:
    """Says which joints turn the other way, have another zero or are shown less or plus a neighbour (pendants of many arms show the
    forearm against the base), if places that were seen then follow the machine, and not as the joints are read."""
    of = {c.meaning: c.index for c in m.guessed if c.repeat == 0}
    if not m.columns or not set(SEEN) <= set(of):
        return
    seen, joints = m.metres([of[a] for a in SEEN], SEEN), m.coordinates()
    rows = np.flatnonzero(np.isfinite(seen).all(axis=1) & np.isfinite(joints).all(axis=1))
    if len(rows) < FEWEST:
        return
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST)).astype(int)]
    seen, q, arm = seen[rows], joints[rows], machine()
    blocks = [numbered(m, name)[rows] for name in ("setup", "target")]

    def off(q: Floats) -> float:
        poses = forward_kinematics(arm, q)
        return places_apart(poses.position, poses.rotation, seen, *blocks)

    there = forward_kinematics(arm, q).position
    there = there[np.isfinite(there).all(axis=1)]
    size = _size(seen)
    if len(there) < FEWEST or not size / ALIKE < _size(there) < size * ALIKE:
        return
    least = OFF * size
    before = now = off(q)
    changed: list[str] = []
    while least < now < np.inf and len(changed) < CHANGES:
        ways = list(_read_otherwise(m, q, arm))
        each = [off(way) for _, way in ways]
        best = int(np.argmin(each))
        if not BETTER * each[best] < now:
            break
        now, q = each[best], ways[best][1]
        changed.append(ways[best][0])
    if changed and CLEAR * now < before:
        m.said.append(
            f"the places seen are {length_text(before)} off in the median where the machine goes to the joints as they stand there, "
            f"{length_text(now)} if {', and '.join(changed)}"
        )


def _size(places: Floats) -> float:
    return float(np.linalg.norm(places.std(axis=0)))


def _read_otherwise(m: Meant, q: Floats, machine: Machine) -> Iterator[tuple[str, Floats]]:
    """Ways of reading one joint more, in words, and the coordinates (n, drives) then."""
    names = [name for name, _ in m.columns.values()]
    legs = [name.rpartition(".")[0] for name in names]
    slides = [machine.compiled.names.is_prismatic(name) for name in names]
    for i, name in enumerate(names):
        short, header = name.split(".")[-1], m.chosen[f"q{i + 1}"][0]

        def changed(values: Floats, at: int = i) -> Floats:
            return np.column_stack([*q.T[:at], values, *q.T[at + 1 :]])

        yield f"{short} goes the other way: --map {short}='-{header}'", changed(-q[:, i])
        for k in (i - 1, i + 1):
            if 0 <= k < len(names) and (legs[k], slides[k]) == (legs[i], slides[i]):
                other = names[k].split(".")[-1]
                for share in (1, -1):
                    text = f"'{header}' is {short} {'less' if share > 0 else 'plus'} {other}: `coupled: {{{other}: {share}}}` at {short} in the machine file"
                    yield text, changed(q[:, i] + share * q[:, k])
        for turn in () if slides[i] else (90, -90, 180):
            yield f"the zero of {short} is {turn} deg elsewhere", changed(q[:, i] + np.radians(turn))

"""Length from an anchor to the point, as a draw-wire sensor or a telescoping ball-bar reads it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import least_squares

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.readings.types import ReadingKind, Seen
from stiffmap.experiment.setups import SEEN, setups_of, target_positions, targets_of

FEWEST = 6
"""Lengths of a set-up, for three coordinates of its anchor and a zero."""
ERROR = 1e-3
"""m: an error of a machine beyond which a row weighs less where anchors are found."""
ARM = 0.2
"""m: how far apart the starts of a target's place are; at that distance from the tool's point it costs as much as one such error."""


def change(here: Seen, there: Seen | None) -> Floats:
    """(n,) m: length to the place less that to the command."""
    apart = here.position - _anchor(here.plan)
    return np.asarray(np.linalg.norm(apart + here.motion[:, :3], axis=1) - np.linalg.norm(apart, axis=1))


def commanded(e: Experiment) -> Floats:
    """(n,) m, with the zero that was found."""
    apart = target_positions(e) - _anchor(e)
    return np.asarray(np.linalg.norm(apart, axis=1) + _of_setup(e, "zero of anchor")[:, 0])


def nuisance(e: Experiment) -> Iterator[Floats]:
    """Zero of the length and, where it is unknown, place of the anchor, one of each per set-up."""
    way = _way(e)
    label = setups_of(e)[0]
    for here in ((label == s).astype(float) for s in np.unique(label)):
        yield here
        if e.anchor is None:
            yield from (here * way[:, k] for k in range(3))


def tool_offset(e: Experiment, arm: Floats, k: int) -> Floats:
    """(n,) change of the length per length of the target's offset."""
    return np.asarray(np.sum(_way(e) * arm, axis=1))


def found(e: Experiment, length: Floats) -> tuple[tuple[str, Floats, Floats], ...]:
    """Anchors and zeros of set-ups and, where it is unknown, the place of each target on the tool.

    Nonlinear least squares, far rows weighed down, from the anchor and zero that the squares of the lengths fit linearly.
    Raises StiffmapError where a set-up has fewer than `FEWEST` lengths.
    """
    good = np.flatnonzero(np.isfinite(length))
    setup, names = setups_of(e)
    target, targets = targets_of(e)
    few = [n for k, n in enumerate(names) if 0 < np.count_nonzero(setup[good] == k) < FEWEST]
    if few:
        raise StiffmapError(
            f"{e.name}: too few lengths to find the anchor of set-up {few[0]} ({FEWEST} or more in each)"
        )
    on_tool = e.tool != "known" and e.rotation is not None and not any(SEEN in p for p in e.points)
    n, m = len(names), len(targets) if on_tool else 0
    place, turn, length = target_positions(e)[good], e.rotation, length[good]
    turns = np.zeros((len(good), 3, 3)) if turn is None else turn[good]
    setup, target = setup[good], target[good]

    def parts(x: Floats) -> tuple[Floats, Floats, Floats]:
        anchors = x[: 3 * n].reshape(n, 3) if e.anchor is None else np.tile(e.anchor, (n, 1))
        return anchors, x[3 * n : 4 * n], x[4 * n :].reshape(m, 3)

    def residual(x: Floats) -> Floats:
        anchors, zeros, tools = parts(x)
        at = place + np.einsum("nij,nj->ni", turns, tools[target]) if m else place
        left = length - zeros[setup] - np.linalg.norm(at - anchors[setup], axis=1)
        return np.concatenate([left, x[4 * n :] * ERROR / ARM])

    arms = [np.zeros(3), *(s * ARM * a for a in np.eye(3) for s in (1, -1))] if m else [np.zeros(3)]
    fits = [
        least_squares(
            residual, np.append(start, np.tile(arm, m)), loss="soft_l1", f_scale=ERROR, x_scale="jac"
        )
        for arm in arms
        for start in _starts(place + turns @ arm, length, setup, n)
    ]
    anchors, zeros, tools = parts(min(fits, key=lambda f: f.cost).x)
    eye = np.eye(3)
    out = [(f"anchor {k}", eye, a) for k, a in zip(names, anchors, strict=True)]
    out += [(f"zero of anchor {k}", eye, np.array([z, 0.0, 0.0])) for k, z in zip(names, zeros, strict=True)]
    return (*out, *((f"target {k}", eye, p) for k, p in zip(targets, tools, strict=False)))


def _starts(place: Floats, length: Floats, setup: Integers, n: int) -> Iterator[Floats]:
    """(4 n,) anchors, then zeros; anchors on either side where the places lie in a plane."""
    for side in (0.0, 1.0, -1.0):
        anchors, zeros = np.zeros((n, 3)), np.zeros(n)
        for k in range(n):
            here = setup == k
            if not here.any():
                continue
            p, s = place[here] - place[here].mean(axis=0), length[here]
            a = np.column_stack([2.0 * p, -2.0 * s, np.ones(len(s))])
            x = np.linalg.lstsq(a, np.sum(p**2, axis=1) - s**2, rcond=1e-6)[0]
            across = np.linalg.svd(p)[2][-1]
            anchors[k] = x[:3] + place[here].mean(axis=0) + side * 0.5 * np.median(s) * across
        yield np.append(anchors, zeros)


def _way(e: Experiment) -> Floats:
    """(n, 3) from the anchor to the target, of length 1."""
    apart = target_positions(e) - _anchor(e)
    return np.asarray(apart / np.linalg.norm(apart, axis=1, keepdims=True))


def _anchor(e: Experiment) -> Floats:
    """(n, 3) m, base axes."""
    return _of_setup(e, "anchor") if e.anchor is None else np.tile(e.anchor, (len(e), 1))


def _of_setup(e: Experiment, what: str) -> Floats:
    """(n, 3) m of what was found, by set-up. Raises StiffmapError where it was not."""
    at = {name: shift for name, _, shift in e.registration}
    number, names = setups_of(e)
    lost = [n for n in names if f"{what} {n}" not in at]
    if lost:
        raise StiffmapError(
            f"{e.name}: column 'll' needs 'anchor' in experiment.yaml, or the column 'length'"
        )
    return np.asarray(np.array([at[f"{what} {n}"] for n in names])[number])


READING = ReadingKind(
    name="ll",
    unit="m",
    title="a length from an anchor",
    change=change,
    quantities=("position",),
    absolute="length",
    commanded=commanded,
    found=found,
    positive=True,
    nuisance=nuisance,
    tool_offset=tool_offset,
)

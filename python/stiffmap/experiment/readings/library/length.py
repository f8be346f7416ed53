"""Length from an anchor to the point, as a draw-wire sensor or a telescoping ball-bar reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.readings.types import ReadingKind, Seen
from stiffmap.experiment.setups import members, setups_of, target_positions, targets_of

FEWEST = 6
"""Lengths of a set-up, for three coordinates of its anchor and a zero."""
ERROR = 1e-3
"""m: an error of a machine beyond which a row weighs less where anchors are found."""
ARM = 0.2
"""m: how far apart the starts of a target's place are; so far from the tool's point it costs as much as one `ERROR`."""


def change(here: Seen, there: Seen | None) -> Floats:
    """(n,) m: length to the place less that to the command."""
    apart = here.position - _anchor(here.plan)
    return np.asarray(np.linalg.norm(apart + here.motion[:, :3], axis=1) - np.linalg.norm(apart, axis=1))


def commanded(e: Experiment) -> Floats:
    """(n,) m, with the zero that was found."""
    return np.asarray(_apart(e)[1] + _found(e, "zero of anchor")[:, 0])


def nuisance(e: Experiment) -> Iterator[Floats]:
    """Zero of the length and, where it is unknown, place of the anchor, one of each per set-up."""
    shapes = [np.ones(len(e)), *(_way(e).T if e.anchor is None else ())]
    yield from (here * shape for here in members(setups_of(e)[0]) for shape in shapes)


def tool_offset(e: Experiment, arm: Floats, k: int) -> Floats:
    """(n,) change of the length per length of the target's offset."""
    return np.asarray(np.sum(_way(e) * arm, axis=1))


def found(e: Experiment, length: Floats) -> tuple[tuple[str, Floats, Floats], ...]:
    """Anchors and zeros of set-ups and, where it is unknown, the place of each target on the tool.

    Nonlinear least squares, far rows weighed down, from those that were found before, or from the anchor and zero that the squares of
    the lengths fit linearly.
    Raises StiffmapError where a set-up has fewer than `FEWEST` lengths.
    """
    good = np.flatnonzero(np.isfinite(length))
    (setup, names), (target, targets) = setups_of(e), targets_of(e)
    before = {name: shift for name, _, shift in e.registration}
    again = before.get(f"anchor {names[0]}") is not None
    on_tool = (
        e.tool != "known" and e.rotation is not None and (again or before.get(f"target {targets[0]}") is None)
    )
    place = e.position if on_tool else target_positions(e)
    place, length, setup, target = place[good], length[good], setup[good], target[good]
    few = [n for k, n in enumerate(names) if 0 < np.count_nonzero(setup == k) < FEWEST]
    if few:
        raise StiffmapError(
            f"{e.name}: too few lengths to find the anchor of set-up {few[0]} ({FEWEST} or more in each)"
        )
    turn = e.rotation[good] if on_tool and e.rotation is not None else np.zeros((len(good), 3, 3))
    n, arms = len(names), [np.zeros(3)]
    if on_tool:
        arms += [side * ARM * a for a in np.eye(3) for side in (1, -1)]

    def parts(x: Floats) -> tuple[Floats, Floats, Floats]:
        anchors, tools = x[: 3 * n].reshape(n, 3), x[4 * n :].reshape(-1, 3)
        return anchors if e.anchor is None else np.tile(e.anchor, (n, 1)), x[3 * n : 4 * n], tools

    def apart(x: Floats) -> Floats:
        anchors, _, tools = parts(x)
        return np.asarray(place + np.einsum("nij,nj->ni", turn, tools[target]) - anchors[setup])

    def residual(x: Floats) -> Floats:
        left = length - parts(x)[1][setup] - np.linalg.norm(apart(x), axis=1)
        return np.append(left, x[4 * n :] * ERROR / ARM)

    def jacobian(x: Floats) -> Floats:
        way = apart(x) / np.linalg.norm(apart(x), axis=1, keepdims=True)
        out, rows = np.zeros((len(good), len(x))), np.arange(len(good))
        out[rows, 3 * n + setup] = -1.0
        for k in range(3):
            out[rows, 3 * setup + k] = way[:, k] * (e.anchor is None)
            out[rows, 4 * n + 3 * target + k] = -np.sum(way * turn[:, :, k], axis=1)
        return np.vstack([out, np.eye(len(x))[4 * n :] * ERROR / ARM])

    starts = [
        np.append(s, np.tile(a, len(targets)))
        for a in arms
        for s in _starts(place + turn @ a, length, setup, n)
    ]
    if again:
        own = [before[f"anchor {k}"] for k in names] + [[before[f"zero of anchor {k}"][0] for k in names]]
        starts = [np.concatenate([*own, *(before.get(f"target {k}", np.zeros(3)) for k in targets)])]
    fits = [
        least_squares(residual, s, jacobian, loss="soft_l1", f_scale=ERROR, x_scale="jac") for s in starts
    ]
    anchors, zeros, tools = parts(min(fits, key=lambda f: f.cost).x)
    told = [(f"anchor {k}", a) for k, a in zip(names, anchors, strict=True)]
    told += [(f"zero of anchor {k}", np.array([z, 0.0, 0.0])) for k, z in zip(names, zeros, strict=True)]
    told += [(f"target {k}", p) for k, p in zip(targets, tools, strict=True) if on_tool]
    return tuple((name, np.eye(3), at) for name, at in told)


def _starts(place: Floats, length: Floats, setup: Integers, n: int) -> Iterator[Floats]:
    """(4 n,) anchors, then zeros; also anchors to either side of places in a plane."""
    for side in (0.0, 0.5, -0.5):
        anchors, zeros = np.zeros((n, 3)), np.zeros(n)
        for k in np.unique(setup):
            centre, own = place[setup == k].mean(axis=0), length[setup == k]
            p = place[setup == k] - centre
            a = np.column_stack([2.0 * p, -2.0 * own, np.ones(len(own))])
            x = np.linalg.lstsq(a, np.sum(p**2, axis=1) - own**2, rcond=1e-6)[0]
            anchors[k] = centre + x[:3] + side * np.median(own) * np.linalg.svd(p)[2][-1]
        yield np.append(anchors, zeros)


def _way(e: Experiment) -> Floats:
    """(n, 3) from the anchor to the target: along the secant from those that were found first to those found last, so that it is exact
    however far these lie apart."""
    (before, short), (way, far) = _apart(replace(e, registration=e.registration[::-1])), _apart(e)
    return np.asarray((before * short[:, None] + way * far[:, None]) / (short + far)[:, None])


def _apart(e: Experiment) -> tuple[Floats, Floats]:
    """(n, 3) direction from the anchor to the target, and (n,) m how far it is."""
    apart = target_positions(e) - _anchor(e)
    far = np.linalg.norm(apart, axis=1)
    return apart / far[:, None], far


def _anchor(e: Experiment) -> Floats:
    """(n, 3) m, base axes."""
    return _found(e, "anchor") if e.anchor is None else np.tile(e.anchor, (len(e), 1))


def _found(e: Experiment, what: str) -> Floats:
    """(n, 3) m of each row's set-up. Raises StiffmapError where it was not found."""
    at = {name: shift for name, _, shift in e.registration}
    number, names = setups_of(e)
    shifts = [at.get(f"{what} {n}") for n in names]
    if any(s is None for s in shifts):
        raise StiffmapError(f"{e.name}: column 'll' needs 'anchor' in experiment.yaml; or give 'length'")
    return np.asarray(np.array(shifts)[number])


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

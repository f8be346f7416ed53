"""Mistakes in how readings were taken or written: gauges and forces with a wrong sign, swapped, or along another axis; rows that are shifted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.prediction.predict import Predictor


@dataclass(frozen=True)
class Slip:
    """A mistake that explains readings better than any part of the machine does."""

    kind: str
    """``sign``, ``swap``, ``direction``, ``factor``, ``load`` or ``shift``."""
    seen: str
    """What the readings show, a clause."""
    check: str
    """What to check, a clause."""
    also: tuple[str, ...]
    """Other checks, of mistakes that these readings cannot distinguish from it."""
    left: float
    """Share of the squared misfit that stays once it is undone."""
    undone: bool
    """Whether everything else in the diagnosis is of readings with it undone."""
    evidence: tuple[str, ...] = ()
    """What linearity and reciprocity say, before and after."""
    factor: float | None = None
    """Reading over prediction, where it is one."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """How the declared machine would read with one mistake, and how that is undone."""

    kind: str
    seen: str
    check: str
    changes: int
    """How many things are wrong at once; of equally good ones the fewest win."""
    prediction: Floats
    """(n, c) m, rad."""
    undo: Callable[[Experiment], Experiment] | None
    keep: Mask | None = None
    """(n,) rows that it speaks of; None: all."""
    factor: float | None = None
    physical: bool = False
    """Whether a part of the machine may show the same: it is then named only where none does."""
    setup: str | None = None
    """The set-up that it is of; None: all."""


AXES = "xyz"
Turn = Mapping[int, tuple[int, int]]
"""Axis -> its true axis and the sign along it."""


def turns(axes: list[int]) -> Iterator[Turn]:
    """Every way to mount gauges along signed axes, but the declared one."""
    for where in permutations(range(3), len(axes)):
        for signs in product((1, -1), repeat=len(axes)):
            turn = dict(zip(axes, zip(where, signs, strict=True), strict=True))
            if any(turn[a] != (a, 1) for a in axes):
                yield turn


def words(turn: Turn, what: str, plural: str) -> tuple[str, str, str]:
    """Kind, what is seen and what to check, of gauges or forces."""
    moved = [a for a, (b, _) in turn.items() if a != b]
    flipped = [a for a, (b, s) in turn.items() if a == b and s < 0]
    names = _listed([AXES[a] for a in flipped])
    if not moved:
        if len(turn) > 1 and len(flipped) == len(turn):
            return "sign", f"all {plural} have the opposite sign", f"check the sign of all {plural}"
        signs = "signs" if len(flipped) > 1 else "sign"
        of = f"{names} of the force" if what == "force" else names
        return "sign", f"{what} {names} has the opposite sign", f"check the {signs} of {of}"
    if len(moved) == 2 and not flipped and {turn[a] for a in moved} == {(a, 1) for a in moved}:
        a, b = (AXES[i] for i in sorted(moved))
        return "swap", f"{what}s {a} and {b} are swapped", f"check which {what} is {a} and which is {b}"
    to = ", ".join(
        f"{AXES[a]} acts along {'-' if s < 0 else '+'}{AXES[b]}"
        for a, (b, s) in sorted(turn.items())
        if (b, s) != (a, 1)
    )
    return "direction", f"{what} {to}", f"check the direction of the {what}s and their signs"


def _changes(turn: Turn) -> int:
    """How many things are wrong: all signs together are one."""
    if all(pair == (a, -1) for a, pair in turn.items()):
        return 1
    return sum(pair != (a, 1) for a, pair in turn.items())


def gauges(e: Experiment, base: Floats) -> Iterator[Hypothesis]:
    """Gauges of x, y, z along other axes; `base` (n, c) m, rad is what the declared machine reads."""
    where = _coordinates(e)
    shown = base + where
    axes = [int(a) for a in np.flatnonzero(e.axis_read[:3])]
    for turn in turns(axes):
        there = shown.copy()
        for a, (b, s) in turn.items():
            there[:, a] = s * shown[:, b]
        kind, seen, check = words(turn, "gauge", "readings")
        changes = _changes(turn)
        yield Hypothesis(kind, seen, check, changes, there - where, partial(mounted, turn=turn))
    for i in range(3, 6):
        if e.axis_read[i] and e.quantity == "deflection":
            there = shown.copy()
            there[:, i] *= -1.0
            name = e.channels[i].name
            yield Hypothesis("sign", f"{name} has the opposite sign", f"check the sign of {name}", 1,
                             there - where, partial(times, factor=-1.0, axes=(i,)))  # fmt: skip


def mounted(e: Experiment, turn: Turn) -> Experiment:
    """The readings moved to the axes along which their gauges are."""
    where = _coordinates(e)
    seen = e.reading + where
    reading, sigma = seen.copy(), e.sigma.copy()
    reading[:, list(turn)] = np.nan
    for a, (b, s) in turn.items():
        reading[:, b], sigma[:, b] = s * seen[:, a], e.sigma[:, a]
    return replace(e, reading=reading - where, sigma=sigma)


def times(e: Experiment, factor: float, axes: tuple[int, ...], setup: str | None = None) -> Experiment:
    """Some channels divided by a factor, noise included, or of one set-up without its noise, which is stated for all."""
    by = np.where(in_setup(e, axes, setup), factor, 1.0)
    return replace(e, reading=e.reading / by, sigma=e.sigma / (np.abs(by) if setup is None else 1.0))


def in_setup(e: Experiment, axes: tuple[int, ...], setup: str | None) -> Mask:
    """(n, c) the readings of some channels, of one set-up or of all."""
    return np.asarray(of_setup(e, setup)[:, None] & np.isin(np.arange(len(e.channels)), axes))


def of_setup(e: Experiment, setup: str | None) -> Mask:
    """(n,) the rows of one set-up, or all."""
    return np.array([setup is None or s == setup for s in e.setup or ("",) * len(e)])


def loads(predictor: Predictor) -> Iterator[Hypothesis]:
    """Forces with other signs or along other axes, each through the full equilibrium."""
    e = predictor.experiment
    axes = [int(a) for a in np.flatnonzero(e.wrench[:, :3].any(axis=0))]
    for turn in turns(axes):
        kind, seen, check = words(turn, "force", "forces")
        if kind == "direction" and len(axes) > 1:
            continue
        undo = partial(pulled, turn=turn)
        there = Predictor(predictor.machine, undo(e), threads=predictor.threads)()
        if len(there) != len(e) or not np.isfinite(there[e.read]).all():
            continue
        yield Hypothesis(kind, seen, check, _changes(turn), there, undo)


def pulled(e: Experiment, turn: Turn) -> Experiment:
    """The forces along the axes that they act along."""
    wrench = e.wrench.copy()
    wrench[:, list(turn)] = 0.0
    for a, (b, s) in turn.items():
        wrench[:, b] = s * e.wrench[:, a]
    return replace(e, wrench=wrench)


def shifts(e: Experiment, base: Floats) -> Iterator[Hypothesis]:
    """Readings that stand one row too high or too low (or one group of repeats); `base` (n, c) m, rad as for `gauges`."""
    n, where = len(e), _coordinates(e)
    for step in steps(e):
        there = np.roll(base + where, step, axis=0)
        keep = np.arange(n) >= step if step > 0 else np.arange(n) < n + step
        way = "below" if step > 0 else "above"
        many = "one row" if abs(step) == 1 else f"{abs(step)} rows"
        yield Hypothesis("shift", f"each reading stands {many} {way} its pose and load",
                         f"check whether the readings are shifted by {many}", 1, there - where,
                         partial(moved, step=step), keep)  # fmt: skip


def steps(e: Experiment) -> list[int]:
    """Rows by which readings may be shifted: one, or one group of repeats, either way."""
    sizes = {1} if e.repeat is None else {1, int(e.repeat.max())}
    return sorted(s for k in sizes for s in (k, -k) if 3 * k <= len(e))


def moved(e: Experiment, step: int) -> Experiment:
    """The readings in the rows to which they belong; rows that are left without are gone."""
    where = _coordinates(e)
    seen = np.roll(e.reading + where, -step, axis=0)
    whole = replace(e, reading=seen - where, sigma=np.roll(e.sigma, -step, axis=0))
    return whole.rows(np.arange(len(e) - step) if step > 0 else np.arange(-step, len(e)))


def _coordinates(e: Experiment) -> Floats:
    """(n, c) what gauges show of the commanded poses: coordinates where positions are read."""
    where = np.zeros((len(e), len(e.channels)))
    if e.quantity == "position":
        where[:, :3] = e.position
    return where


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else ""

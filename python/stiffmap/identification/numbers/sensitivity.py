"""How readings change with what may be off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from stiffmap.common.broadcasting import Mask
from stiffmap.common.errors import StiffmapError
from stiffmap.common.kept import Kept
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.prediction.nearby import Ahead, Near
from stiffmap.experiment.prediction.predict import Predictor, fingerprint
from stiffmap.identification.numbers.certificate import INSTRUMENT, SCALE, frame_columns, scaled
from stiffmap.identification.numbers.unknowns import Unknown
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.with_errors import Knots, edited
from stiffmap.solve.machine import Machine

STEP, SMALL = 0.1, 2e-4
"""Of a standard uncertainty, for differences of whole predictions and for slopes."""
AT_ONCE = 64
"""Unknowns whose slopes are computed together."""
Moves = Mapping[tuple[str, str], float]


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How the readings depend on each unknown."""

    unknowns: tuple[Unknown, ...]
    columns: Floats
    """(n, c, p) change of the readings per standard uncertainty."""
    base: Floats
    """(n, c) prediction of the declared machine."""
    failed: tuple[tuple[str, str], ...] = ()
    """Unknowns that the machine cannot be built or solved with, and why."""


BENT = 0.05
"""Share of a fit's whole change that a straight line misses, beyond which columns are taken anew at the fit."""
_KEPT: Kept[tuple[str, tuple[Unknown, ...]], Sensitivity] = Kept(4)


def moves_of(pairs: Iterable[tuple[Unknown, float]]) -> dict[tuple[str, str], float]:
    """By how much each number is off, of unknowns at values in standard uncertainties."""
    moves: dict[tuple[str, str], float] = {}
    for unknown, value in pairs:
        for place, weight in unknown.moves:
            moves[place] = moves.get(place, 0.0) + weight * unknown.u * value
    return moves


def with_numbers(predictor: Predictor, moves: Moves, here: Mask | None = None) -> Predictor:
    """What predicts the machine with its own numbers off, in the rows `here` (n,), None: all; the instrument's are left out."""
    if here is not None and not here.all():
        predictor = predictor.beside(rows=here)
    machine = predictor.machine
    moved = with_moves(machine.description, moves)
    if moved is machine.description:
        return predictor
    return predictor.beside(machine=Machine(moved, like=machine))


def with_moves(
    description: MachineDescription, moves: Moves, travel: Mapping[str, Knots] | None = None
) -> MachineDescription:
    """The description with its own numbers off, and with axis positioning errors of its drives; the instrument's are left out."""
    own = {(at, what): by for (at, what), by in moves.items() if at != INSTRUMENT}
    return edited(description, own, travel) if own or travel else description


def slopes_at(predictor: Predictor, unknowns: Sequence[Unknown], values: Floats) -> Ahead[int]:
    """Changes (n, c) of the readings per standard uncertainty of each unknown, by its number, at some values (p,).

    Those of a set-up and of the instrument, and what one step does not lead to, are for whole predictions.
    """
    description = predictor.machine.description
    pairs = [(u, float(v)) for u, v in zip(unknowns, values, strict=True) if v != 0.0]
    here = moves_of(pairs)
    scale = here.pop((INSTRUMENT, SCALE), 0.0)
    terms = (scaled(description, scale),) if scale else ()
    apart = any(u.setup and u.group != INSTRUMENT for u, _ in pairs)  # a machine for each set-up
    plain = [k for k, u in enumerate(unknowns) if not u.setup and u.group != INSTRUMENT]

    @cache
    def base() -> Predictor:
        return with_numbers(predictor, here)

    def moved(u: Unknown, by: float) -> MachineDescription:
        more = {place: here.get(place, 0.0) + weight * u.u * by for place, weight in u.moves}
        return with_moves(description, {**here, **more})

    def tell(some: Sequence[int]) -> list[Floats | None]:
        near = {}
        for k in some:
            with suppress(StiffmapError):  # what cannot be built: its own prediction will say why
                near[k] = Near(moved(unknowns[k], SMALL), partial(moved, unknowns[k], 0.0))
        told = dict(zip(near, base().changes_of_machines(list(near.values()), terms), strict=True))
        return [None if (change := told.get(k)) is None else change / SMALL for k in some]

    return Ahead([] if apart else plain, AT_ONCE, tell)


def predicted(
    predictor: Predictor, unknowns: Sequence[Unknown], values: Floats, terms: Sequence[AppliedEffect] = ()
) -> Floats:
    """(n, c) readings of the machine with unknowns at `values` (p,), in standard uncertainties, and with effects."""
    pairs = [(u, float(v)) for u, v in zip(unknowns, values, strict=True) if v != 0.0]
    out = np.full(predictor.experiment.reading.shape, np.nan)
    label = np.array(predictor.experiment.setup or ("",) * len(predictor.experiment))
    own = list(dict.fromkeys(u.setup for u, _ in pairs if u.setup))
    for name in (*own, ""):  # the rows of each set-up that has unknowns of its own, then all others
        here = label == name if name else ~np.isin(label, own)
        if not here.any():
            continue
        moves = moves_of((u, v) for u, v in pairs if u.setup in ("", name))
        scale = moves.pop((INSTRUMENT, SCALE), 0.0)
        moved = tuple((at, by) for at, by in moves.items() if at[0] != INSTRUMENT)
        key = (name, here.tobytes(), moved)
        mine = predictor.kept(key, partial(with_numbers, predictor, dict(moved), here))
        of_instrument = [scaled(predictor.machine.description, scale)] if scale else []
        out[here] = mine([*terms, *of_instrument])
    return np.asarray(out + _frame_part(predictor, pairs))


def _frame_part(predictor: Predictor, pairs: Sequence[tuple[Unknown, float]]) -> Floats | float:
    """(n, c) what frames add that are known within an uncertainty."""
    moved = [(what, w * u.u * v) for u, v in pairs for (at, what), w in u.moves if at == INSTRUMENT]
    moved = [(what, by) for what, by in moved if what != SCALE]
    if not moved:
        return 0.0
    columns = frame_columns(predictor.experiment, predictor())
    return np.asarray(sum(columns[what] * by for what, by in moved))


def sensitivity(predictor: Predictor, unknowns: Sequence[Unknown]) -> Sensitivity:
    """Slopes of the readings, or differences of variants of the machine, one per unknown.

    The last few are kept: they do not depend on the readings.
    """
    key = (fingerprint(predictor), tuple(unknowns))
    return _KEPT.made(key, lambda: _differences(predictor, unknowns))


def bends(white: Callable[[Floats], Floats], s: Sensitivity, values: Floats, prediction: Floats) -> bool:
    """Whether the columns at the fit differ so much from `s.columns` that standard deviations would be wrong.

    Along the fit's own direction they differ by twice what the straight line misses; `white` (n, c) -> (N,), and the noise of one
    reading is no difference.
    """
    straight = s.columns @ values
    missed = white(prediction - s.base - straight)
    return 2.0 * float(np.linalg.norm(missed)) > max(BENT * float(np.linalg.norm(white(straight))), 1.0)


def sensitivity_at(predictor: Predictor, s: Sensitivity, values: Floats) -> Sensitivity:
    """The same unknowns with columns at `values` (p,); those that fail there keep the old ones, and so do rows that do."""
    columns = s.columns.copy()
    base = predicted(predictor, s.unknowns, values)
    solved = np.isfinite(base)
    for k, column, _ in _columns(predictor, s.unknowns, values, base):
        if column is not None:
            columns[..., k] = np.where(solved, column, columns[..., k])
    return replace(s, columns=columns)


def _columns(
    predictor: Predictor, unknowns: Sequence[Unknown], values: Floats, base: Floats
) -> Iterator[tuple[int, Floats | None, str]]:
    """Each unknown with (n, c) its slopes at `values`, where the machine shows `base`, or why there are none."""
    slopes, solved = slopes_at(predictor, unknowns, values), np.isfinite(base)
    for k in range(len(unknowns)):
        try:
            column = slopes.of(k)
            if column is None:
                moved = values + STEP * (np.arange(len(values)) == k)
                column = (predicted(predictor, unknowns, moved) - base) / STEP
        except StiffmapError as problem:
            yield k, None, str(problem)
            continue
        if np.isfinite(column[solved]).all():
            yield k, column, ""
        else:
            yield k, None, "the machine has no equilibrium with it at some poses"


def _differences(predictor: Predictor, unknowns: Sequence[Unknown]) -> Sensitivity:
    base = predictor()
    each = list(_columns(predictor, unknowns, np.zeros(len(unknowns)), base))
    shown = [(unknowns[k], c) for k, c, _ in each if c is not None and np.any(np.nan_to_num(c))]
    stack = np.stack([c for _, c in shown], axis=-1) if shown else np.zeros((*base.shape, 0))
    failed = tuple((unknowns[k].name, why) for k, c, why in each if c is None)
    return Sensitivity(tuple(u for u, _ in shown), stack, base, failed)


def zeros_anew(s: Sensitivity, experiment: Experiment) -> Sensitivity:
    """The same unknowns, and where there are several set-ups a zero of each drive in each, with the zero's own standard uncertainty: a
    machine is homed or adjusted between two sessions, which nobody writes down."""
    names = np.unique(experiment.setup)
    zeros = [i for i, u in enumerate(s.unknowns) if u.group == "zeros" and not u.setup]
    if len(names) < 2 or not zeros or experiment.quantity != "position":
        return s
    each = [(str(name), s.unknowns[i], s.columns[..., i]) for name in names for i in zeros]
    more = [replace(u, name=f"{u.name} in set-up {name}", setup=name) for name, u, _ in each]
    columns = [np.where((np.array(experiment.setup) == name)[:, None], c, 0.0) for name, _, c in each]
    stack = np.concatenate([s.columns, np.stack(columns, axis=-1)], axis=-1)
    return replace(s, unknowns=(*s.unknowns, *more), columns=stack)

"""Sensitivities of every candidate at the null: slopes, or differences of predictions; kept per plan."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.whitening import readings_of
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.slopes import Slopes, side
from stiffmap.identification.candidates.waves import Wave, Waves
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import Parameter, get
from stiffmap.model.effects.evidence import Periods, Tried, signatures_on_a_grid

Shape = tuple[tuple[str, float], ...]
Start = Callable[[Floats], Mapping[str, float]]
Numbers = NDArray[np.intp]
MOST_STORED = 5_000_000
"""Numbers that the periods of one candidate may store; more are computed anew wherever they are needed."""
# Share of a parameter's scale for a difference: laws that only grow from their null take all of it
SMOOTH, ONE_SIDED = 0.1, 1.0


@dataclass(frozen=True, eq=False)
class Variant:
    """Linear model of a candidate at the null.

    lines
        (p, R) change of all readings (`readings_of`) per `scale` of each linear parameter; a `Wave` where they are not
        stored.
    shape
        Values of the parameters without a null at which the columns hold.
    sign
        (p,) +1 where the parameter can only grow from its null, -1 only fall, 0 both.
    start
        Values of further parameters from the strengths of the columns.
    """

    candidate: Candidate
    lines: Floats | Wave
    sign: Floats
    shape: Shape = ()
    start: Start | None = None

    def array(self) -> Floats:
        """(p, R) the columns, one per line."""
        return self.lines.array() if isinstance(self.lines, Wave) else self.lines


def variants(
    candidate: Candidate, predictor: Predictor, base: Floats, slopes: Slopes | None = None
) -> Iterator[Variant | None]:
    """One linear model per signature of a candidate; None where the machine fails with it. `slopes`: computed ahead."""
    slopes = slopes or Slopes(predictor, [candidate])
    tried = Tried(candidate.element, candidate.legs, candidate.parameters)
    linear = candidate.linear
    index = readings_of(predictor.experiment, base)
    waves: dict[int, tuple[Waves, Floats | None] | None] = {}
    for s in (get(candidate.kind).signature or signatures_on_a_grid)(PlanProbe(predictor, base), tried):
        shape = tuple(s.values.items())
        if s.period is not None:
            periods, k = s.period
            if id(periods) not in waves:
                waves[id(periods)] = _waves(periods, base, index)
            yield _variant(
                candidate, _wave(waves[id(periods)], k), np.full(2, float(s.grows)), shape, s.start
            )
        elif s.columns is not None:
            sign = np.full(s.columns.shape[-1], float(s.grows))
            yield _variant(candidate, lines_of(s.columns, base, index), sign, shape, s.start)
        else:
            single = [
                difference(candidate, p, shape, predictor, base) if told is None else told
                for p in linear
                for told in [slopes.of(candidate, p)]
            ]
            found = lines_of(np.stack(single, axis=-1), base, index)
            yield _variant(candidate, found, np.array([side(p) for p in linear]), shape, s.start)


def _variant(
    candidate: Candidate, lines: Floats | Wave | None, sign: Floats, shape: Shape, start: Start | None
) -> Variant | None:
    return None if lines is None else Variant(candidate, lines, sign, shape, start)


def lines_of(columns: Floats, base: Floats, index: tuple[Numbers, Numbers]) -> Floats | None:
    """(p, R) of (n, c, p): the columns of the readings, one per line; None where the machine fails."""
    if not np.isfinite(columns[np.isfinite(base)]).all():
        return None
    return np.ascontiguousarray(columns[index].T)


def _waves(
    periods: Periods, base: Floats, index: tuple[Numbers, Numbers]
) -> tuple[Waves, Floats | None] | None:
    """All periods, and their columns (F, 2, R) where these are few enough to be stored; None where the machine fails."""
    solved = np.isfinite(base)
    if not all(np.isfinite(c[solved]).all() for c in periods.changes):
        return None
    waves = Waves.of(index[0], periods.travels, [c[index] for c in periods.changes], periods.frequencies)
    stored = 2 * len(periods.frequencies) * len(index[0]) <= MOST_STORED
    return waves, waves.arrays() if stored else None


def _wave(found: tuple[Waves, Floats | None] | None, k: int) -> Floats | Wave | None:
    if found is None:
        return None
    waves, stored = found
    return Wave(waves, k) if stored is None else np.asarray(stored[k])


def difference(
    candidate: Candidate, p: Parameter, shape: Shape, predictor: Predictor, base: Floats
) -> Floats:
    """(n, c) change of the readings per scale of parameter p, one-sided from the null, of whole predictions."""
    step = (side(p) * ONE_SIDED or SMOOTH) * p.scale
    given = dict(shape) | {p.name: float(p.null or 0.0) + step}
    values = [given.get(q.name, float(q.null or 0.0)) for q in candidate.parameters]
    raw = predictor([candidate.term(values)]) - base
    return np.asarray(raw / (step / p.scale))


STEP = 10.0  # N


@dataclass(frozen=True, eq=False)
class PlanProbe:
    """Implements `effects.evidence.Probe`."""

    predictor: Predictor
    base: Floats

    @property
    def plan(self) -> Experiment:
        """The experiment."""
        return self.predictor.experiment

    def change(self, term: AppliedEffect) -> Floats:
        """(n, c) m, rad: what another effect adds to every reading."""
        return self.predictor([term]) - self.base

    def coordinate(self, element: str, leg: str) -> Floats:
        """(n,) m, rad: commanded coordinate of a drive from its home."""
        machine = self.predictor.machine
        names = machine.actuators
        mine = [n.split(".")[0] == leg if leg else "." not in n for n in names]
        found = [k for k, n in enumerate(names) if mine[k] and n.split(".")[-1] == element]
        if not found:
            raise StiffmapError(f"{f'{leg}.{element}' if leg else element} is no drive of {machine.name}")
        compiled = machine.compiled
        joint = compiled.names.joints[names[found[0]]]
        return np.asarray(self._coordinates[:, joint] - compiled.home_coordinates()[joint])

    @cached_property
    def _coordinates(self) -> Floats:
        return coordinates_of(self.predictor.machine, self.plan)

    def compliance(self) -> Floats:
        """(n, c, 3) change of every reading per newton along x, y, z at the loaded point.

        Where the machine gives way under a little more, by a little less; NaN where it does under both.
        """
        load = self.plan.wrench
        out = []
        for axis in np.eye(6)[:3]:
            slope = (self.predictor.under(load + STEP * axis) - self.base) / STEP
            if not np.isfinite(slope[np.isfinite(self.base)]).all():
                less = (self.base - self.predictor.under(load - STEP * axis)) / STEP
                slope = np.where(np.isfinite(slope), slope, less)
            out.append(slope)
        return np.stack(out, axis=-1)

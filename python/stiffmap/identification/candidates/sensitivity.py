"""Sensitivities of every candidate at the null: slopes, or differences of predictions; kept for the next diagnosis of a plan."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.fingerprints import digest
from stiffmap.common.kept import Kept
from stiffmap.experiment.experiment import Experiment, Floats, Integers
from stiffmap.experiment.noise.whitening import readings_of
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.nearby import Ahead
from stiffmap.experiment.prediction.predict import Predictor, fingerprint
from stiffmap.identification.candidates.candidates import Candidate, candidates
from stiffmap.identification.clock import Clock
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import Parameter, get, kinds
from stiffmap.model.effects.evidence import Many, Tried, signatures_on_a_grid

Shape = tuple[tuple[str, float], ...]
Start = Callable[[Floats], Mapping[str, float]]
Index = tuple[Integers, Integers]
"""Row and channel of each of R readings."""
EVERY = slice(None)
# Share of a parameter's scale for a difference: laws that only grow from their null take all of it
SMOOTH, ONE_SIDED = 0.1, 1.0
AT_ONCE = 48
"""Slopes that are computed together; between two candidates a diagnosis may be stopped."""
# Shares of a parameter's scale for a slope. One step leaves of it what is quadratic in the change: of a length or an angle
# little, whose deflections need the larger step against round-off; of a factor on a compliance the factor's change itself,
# and of a compliance that is added its share of what is there.
LENGTHS, OTHERS = 1e-2, 2e-5
Key = tuple[Candidate, Parameter]


@dataclass(frozen=True, eq=False)
class OneOf:
    """Columns at one of many values that are tried alike."""

    many: Many
    number: int
    index: Index

    def lines(self, use: Integers | slice) -> Floats:
        """(p, N) columns of some of the readings."""
        return self.many.columns(self.number, self.index[0][use], self.index[1][use])


@dataclass(frozen=True, eq=False)
class Variant:
    """Linear model of a candidate at the null.

    columns
        (p, R) change of all readings (`readings_of`) per `scale` of each linear parameter, or what makes them.
    shape
        Values of the parameters without a null at which the columns hold.
    sign
        (p,) +1 where the parameter can only grow from its null, -1 only fall, 0 both.
    start
        Values of further parameters from the strengths of the columns.
    most
        Largest strength, in scales.
    """

    candidate: Candidate
    columns: Floats | OneOf
    sign: Floats
    shape: Shape = ()
    start: Start | None = None
    most: float = np.inf

    def lines(self, use: Integers | slice = EVERY) -> Floats:
        """(p, N) the columns, one per line, of some of the readings, else of all."""
        return self.columns.lines(use) if isinstance(self.columns, OneOf) else self.columns[:, use]


def variants(
    candidate: Candidate, predictor: Predictor, base: Floats, slopes: Ahead[Key] | None = None
) -> Iterator[Variant | None]:
    """One linear model per signature of a candidate; None where the machine fails with it. `slopes`: computed ahead."""
    slopes = slopes or slopes_of(predictor, [candidate])
    tried = Tried(candidate.element, candidate.legs, candidate.parameters)
    linear = candidate.linear
    index = readings_of(predictor.experiment, base)
    solved, last, finite = np.isfinite(base), None, False
    for s in (get(candidate.kind).signature or signatures_on_a_grid)(PlanProbe(predictor, base), tried):
        shape = tuple(s.values.items())
        if s.one_of is not None:
            many, k = s.one_of
            if many is not last:  # once for all of its values
                last, finite = many, all(np.isfinite(c[solved]).all() for c in many.changes)
            columns: Floats | OneOf | None = OneOf(many, k, index) if finite else None
            sign = np.full(many.size, float(s.grows))
        elif s.columns is not None:
            columns, sign = lines_of(s.columns, base, index), np.full(s.columns.shape[-1], float(s.grows))
        else:
            single = [
                difference(candidate, p, shape, predictor, base) if told is None else told
                for p in linear
                for told in [slopes.of((candidate, p))]
            ]
            columns = lines_of(np.stack(single, axis=-1), base, index)
            sign = np.array([side(p) for p in linear])
        yield None if columns is None else Variant(candidate, columns, sign, shape, s.start, s.most)


def lines_of(columns: Floats, base: Floats, index: Index) -> Floats | None:
    """(p, R) of (n, c, p): the columns of the readings, one per line; None where the machine fails."""
    if not np.isfinite(columns[np.isfinite(base)]).all():
        return None
    return np.ascontiguousarray(columns[index].T)


def difference(
    candidate: Candidate, p: Parameter, shape: Shape, predictor: Predictor, base: Floats
) -> Floats:
    """(n, c) change of the readings per scale of parameter p, one-sided from the null, of whole predictions."""
    step = (side(p) * ONE_SIDED or SMOOTH) * p.scale
    raw = predictor([candidate.term_of(dict(shape) | {p.name: float(p.null or 0.0) + step})]) - base
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


def slopes_of(predictor: Predictor, candidates: Iterable[Candidate]) -> Ahead[Key]:
    """Changes (n, c) of the readings per scale of each parameter at its null."""

    def tell(some: Sequence[Key]) -> list[Floats | None]:
        moved = [(c.term_of({p.name: float(p.null or 0.0) + step_of(p)}),) for c, p in some]
        changes = predictor.changes(moved, unmoved=[(c.term_of({}),) for c, _ in some])
        return [
            None if change is None else change / (step_of(p) / p.scale)
            for (_, p), change in zip(some, changes, strict=True)
        ]

    wanted = [(c, p) for c in candidates if _is_smooth(c) for p in c.linear if side(p) == 0]
    return Ahead(wanted, AT_ONCE, tell)


def _is_smooth(candidate: Candidate) -> bool:
    """Whether an effect of the machine shows by its slopes alone."""
    effect = get(candidate.kind)
    return effect.apply is not None and effect.signature is None and not candidate.shape


def side(p: Parameter) -> int:
    """+1 where the parameter can only grow from its null, -1 only fall, 0 both."""
    return int(p.lower == p.null) - int(p.upper == p.null)


def step_of(p: Parameter) -> float:
    """By how much a parameter is moved for its slope at the null."""
    smooth = p.null is not None and p.unit.split("/")[0] in ("m", "rad") and "N" not in p.unit
    return (LENGTHS if smooth else OTHERS) * p.scale


@dataclass(frozen=True)
class CandidatePlan:
    """What does not depend on the readings."""

    base: Floats
    """(n, 6) prediction of the declared machine."""
    variants: tuple[Variant, ...]
    """All of them, with their columns."""
    failed: tuple[tuple[Candidate, str], ...]


_PLANS: Kept[str, CandidatePlan] = Kept(8)


def plan_of(predictor: Predictor, clock: Clock | None = None) -> CandidatePlan:
    """Sensitivities of a machine under a plan; the last eight are kept. The clock learns which are computed; where it
    is over those that there are make the plan, which is not kept."""
    clock = clock or Clock()
    registered = [(k, id(get(k))) for k in kinds()]  # users may register more
    key = digest(fingerprint(predictor), predictor.experiment.read, registered)
    kept = _PLANS.get(key)
    if kept is not None:
        return kept
    base = predictor()
    good: list[Variant] = []
    failed: list[tuple[Candidate, str]] = []
    kind, whole = "", True
    tried = candidates(predictor.machine.description, predictor.experiment)
    slopes = slopes_of(predictor, tried)
    for candidate in tried:
        if clock.over:
            where = "some places" if candidate.kind == kind else "any place"
            clock.left_out.append(f"{candidate.kind} at {where}: no sensitivities")
            whole = False
            continue
        if candidate.kind != kind:
            kind = candidate.kind
            clock.say(f"sensitivities: {kind}")
        try:
            found = list(variants(candidate, predictor, base, slopes))
        except StiffmapError as problem:
            failed.append((candidate, str(problem)))
            continue
        usable = [v for v in found if v is not None]
        good += usable
        if not usable:
            failed.append((candidate, "the machine has no equilibrium with it at some poses"))
    plan = CandidatePlan(base, tuple(good), tuple(failed))
    return _PLANS.put(key, plan) if whole else plan

"""Sensitivities of every candidate at the null, by differences of predictions; kept per plan."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.diagnosis.candidates.candidates import Candidate, candidates
from stiffmap.diagnosis.candidates.probe import PlanProbe
from stiffmap.effects import Parameter, get, kinds
from stiffmap.effects.evidence import Tried, signatures_on_a_grid
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.fingerprint import fingerprint
from stiffmap.experiment.prediction.predict import Predictor

Shape = tuple[tuple[str, float], ...]
# Share of a parameter's scale for a difference: laws that only grow from their null take all of it
SMOOTH, ONE_SIDED = 0.1, 1.0


@dataclass(frozen=True, eq=False)
class Variant:
    """Linear model of a candidate at the null.

    columns
        (n, 6, p) change of the readings per `scale` of each linear parameter.
    shape
        Values of the parameters without a null at which the columns hold.
    sign
        (p,) +1 where the parameter can only grow from its null, -1 only fall, 0 both.
    start
        Values of further parameters from the strengths of the columns.
    """

    candidate: Candidate
    columns: Floats
    sign: Floats
    shape: Shape = ()
    start: Callable[[Floats], Mapping[str, float]] | None = None


@dataclass(frozen=True)
class Plan:
    """What does not depend on the readings."""

    base: Floats
    """(n, 6) prediction of the declared machine."""
    variants: tuple[Variant, ...]
    failed: tuple[tuple[Candidate, str], ...]
    digest: str = ""
    """Of the machine and the plan."""


_PLANS: OrderedDict[str, Plan] = OrderedDict()


def plan_of(predictor: Predictor) -> Plan:
    """Sensitivities of a machine under a plan; the last eight are kept."""
    key = fingerprint(predictor) + repr([(k, id(get(k))) for k in kinds()])  # users may register more
    if key not in _PLANS:
        _PLANS[key] = replace(_compute(predictor), digest=key)
        if len(_PLANS) > 8:
            _PLANS.popitem(last=False)
    _PLANS.move_to_end(key)
    return _PLANS[key]


def _compute(predictor: Predictor) -> Plan:
    base = predictor()
    good: list[Variant] = []
    failed: list[tuple[Candidate, str]] = []
    for candidate in candidates(predictor.machine.description, predictor.experiment):
        try:
            found = list(variants(candidate, predictor, base))
        except StiffmapError as problem:
            failed.append((candidate, str(problem)))
            continue
        good += [v for v in found if _usable(v, base)]
        if not any(_usable(v, base) for v in found):
            failed.append((candidate, "the machine fails with it"))
    return Plan(base, tuple(good), tuple(failed))


def _usable(variant: Variant, base: Floats) -> bool:
    return bool(np.isfinite(variant.columns[np.isfinite(base)]).all())


def variants(candidate: Candidate, predictor: Predictor, base: Floats) -> Iterator[Variant]:
    """One linear model per signature of a candidate."""
    tried = Tried(candidate.element, candidate.legs, candidate.parameters)
    linear = candidate.linear
    for s in (get(candidate.kind).signature or signatures_on_a_grid)(PlanProbe(predictor, base), tried):
        shape = tuple(s.values.items())
        if s.columns is not None:
            sign = np.full(s.columns.shape[-1], float(s.grows))
            yield Variant(candidate, s.columns, sign, shape, s.start)
            continue
        single = [difference(candidate, p, shape, predictor, base) for p in linear]
        yield Variant(
            candidate, np.stack(single, axis=-1), np.array([side(p) for p in linear]), shape, s.start
        )


def side(p: Parameter) -> int:
    """+1 where the parameter can only grow from its null, -1 only fall, 0 both."""
    return int(p.lower == p.null) - int(p.upper == p.null)


def difference(
    candidate: Candidate, p: Parameter, shape: Shape, predictor: Predictor, base: Floats
) -> Floats:
    """(n, 6) change of the readings per scale of parameter p, one-sided from the null."""
    step = (side(p) * ONE_SIDED or SMOOTH) * p.scale
    given = dict(shape) | {p.name: float(p.null or 0.0) + step}
    values = [given.get(q.name, float(q.null or 0.0)) for q in candidate.parameters]
    raw = predictor([candidate.term(values)]) - base
    return np.asarray(raw / (step / p.scale))

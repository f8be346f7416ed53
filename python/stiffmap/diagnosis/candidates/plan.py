"""Sensitivities of all candidates under a plan, kept for the next diagnosis of it."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.diagnosis.candidates.candidates import Candidate, candidates
from stiffmap.diagnosis.candidates.sensitivity import Variant, variants
from stiffmap.diagnosis.candidates.stack import Stack
from stiffmap.effects import get, kinds
from stiffmap.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.fingerprint import fingerprint
from stiffmap.experiment.prediction.predict import Predictor


@dataclass(frozen=True)
class Plan:
    """What does not depend on the readings."""

    base: Floats
    """(n, 6) prediction of the declared machine."""
    stack: Stack
    """All variants, with their columns."""
    failed: tuple[tuple[Candidate, str], ...]
    digest: str = ""
    """Of the machine and the plan."""

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All of them."""
        return self.stack.variants


_PLANS: OrderedDict[str, Plan] = OrderedDict()


def plan_of(predictor: Predictor, say: Callable[[str], None] | None = None) -> Plan:
    """Sensitivities of a machine under a plan; the last eight are kept. `say` is told which are computed."""
    read = hashlib.sha256(np.packbits(predictor.experiment.read).tobytes()).hexdigest()
    key = fingerprint(predictor) + read + repr([(k, id(get(k))) for k in kinds()])  # users may register more
    if key not in _PLANS:
        _PLANS[key] = replace(_compute(predictor, say), digest=key)
        if len(_PLANS) > 8:
            _PLANS.popitem(last=False)
    _PLANS.move_to_end(key)
    return _PLANS[key]


def _compute(predictor: Predictor, say: Callable[[str], None] | None) -> Plan:
    base = predictor()
    good: list[Variant] = []
    failed: list[tuple[Candidate, str]] = []
    kind = ""
    for candidate in candidates(predictor.machine.description, predictor.experiment):
        if say is not None and candidate.kind != kind:
            kind = candidate.kind
            say(f"sensitivities: {kind}")
        try:
            found = list(variants(candidate, predictor, base))
        except StiffmapError as problem:
            failed.append((candidate, str(problem)))
            continue
        usable = [v for v in found if v is not None]
        good += usable
        if not usable:
            failed.append((candidate, "the machine fails with it"))
    return Plan(base, Stack.of(good), tuple(failed))

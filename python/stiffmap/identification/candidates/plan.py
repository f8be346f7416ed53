"""Sensitivities of all candidates under a plan, kept for the next diagnosis of it."""

from __future__ import annotations

from dataclasses import dataclass

from stiffmap.common.errors import StiffmapError
from stiffmap.common.fingerprints import digest
from stiffmap.common.kept import Kept
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.predict import Predictor, fingerprint
from stiffmap.identification.candidates.candidates import Candidate, candidates
from stiffmap.identification.candidates.sensitivity import Variant, slopes_of, variants
from stiffmap.identification.clock import Clock
from stiffmap.model.effects import get, kinds


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
            clock.leave_out(f"{candidate.kind} at {where}: no sensitivities")
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

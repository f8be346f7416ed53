"""Slopes of the readings by what may go both ways from its null, of many candidates at once."""

from __future__ import annotations

from collections.abc import Iterable

from stiffmap.diagnosis.candidates.candidates import Candidate
from stiffmap.effects import Parameter, get
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.predict import Predictor

AT_ONCE = 48
"""Slopes that are told together; between two candidates a diagnosis may be stopped."""
# Shares of a parameter's scale for a slope. One step leaves of it what is quadratic in the change: of a length or an angle
# little, whose deflections need the larger step against round-off; of a factor on a compliance the factor's change itself.
LENGTHS, OTHERS = 1e-2, 2e-5
Key = tuple[Candidate, str]


class Slopes:
    """Slopes per scale at the null, told ahead in the order in which they will be asked for."""

    def __init__(self, predictor: Predictor, candidates: Iterable[Candidate]) -> None:
        self._predictor = predictor
        wanted = [(c, p) for c in candidates if _is_smooth(c) for p in c.linear if side(p) == 0]
        self._wanted = wanted
        self._place = {(c, p.name): i for i, (c, p) in enumerate(wanted)}
        self._told: dict[Key, Floats | None] = {}

    def of(self, candidate: Candidate, p: Parameter) -> Floats | None:
        """(n, c) change of the readings per scale of a parameter; None where a whole prediction must tell."""
        key = (candidate, p.name)
        if key not in self._place:
            return None
        if key not in self._told:
            self._tell(self._place[key])
        return self._told.pop(key)

    def _tell(self, first: int) -> None:
        some = self._wanted[first : first + AT_ONCE]
        moved = [
            (c.term([_null(q) + (step_of(p) if q is p else 0.0) for q in c.parameters]),) for c, p in some
        ]
        unmoved = [(c.term([_null(q) for q in c.parameters]),) for c, _ in some]
        changes = self._predictor.changes(moved, unmoved=unmoved)
        for (c, p), change in zip(some, changes, strict=True):
            self._told[c, p.name] = None if change is None else change / (step_of(p) / p.scale)


def _is_smooth(candidate: Candidate) -> bool:
    """Whether an effect of the machine shows by its slopes alone."""
    effect = get(candidate.kind)
    return effect.apply is not None and effect.signature is None and not candidate.shape


def _null(p: Parameter) -> float:
    return float(p.null or 0.0)


def side(p: Parameter) -> int:
    """+1 where the parameter can only grow from its null, -1 only fall, 0 both."""
    return int(p.lower == p.null) - int(p.upper == p.null)


def step_of(p: Parameter) -> float:
    """By how much a parameter is moved for its slope."""
    return (LENGTHS if p.unit.split("/")[0] in ("m", "rad") else OTHERS) * p.scale

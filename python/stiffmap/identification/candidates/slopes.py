"""Slopes of the readings by what may go both ways from its null, of many candidates at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.ahead import Ahead
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.model.effects import Parameter, get

AT_ONCE = 48
"""Slopes that are computed together; between two candidates a diagnosis may be stopped."""
# Shares of a parameter's scale for a slope. One step leaves of it what is quadratic in the change: of a length or an angle
# little, whose deflections need the larger step against round-off; of a factor on a compliance the factor's change itself,
# and of a compliance that is added its share of what is there.
LENGTHS, OTHERS = 1e-2, 2e-5
Key = tuple[Candidate, Parameter]


class Slopes:
    """Slopes per scale at the null, computed ahead in the order in which they will be asked for."""

    def __init__(self, predictor: Predictor, candidates: Iterable[Candidate]) -> None:
        self._predictor = predictor
        wanted = [(c, p) for c in candidates if _is_smooth(c) for p in c.linear if side(p) == 0]
        self._ahead = Ahead(wanted, AT_ONCE, self._tell)

    def of(self, candidate: Candidate, p: Parameter) -> Floats | None:
        """(n, c) change of the readings per scale of a parameter; None where a whole prediction must tell."""
        return self._ahead.of((candidate, p))

    def _tell(self, some: Sequence[Key]) -> list[Floats | None]:
        moved = [(c.term_of({p.name: float(p.null or 0.0) + step_of(p)}),) for c, p in some]
        unmoved = [(c.term_of({}),) for c, _ in some]
        changes = self._predictor.changes(moved, unmoved=unmoved)
        return [
            None if change is None else change / (step_of(p) / p.scale)
            for (_, p), change in zip(some, changes, strict=True)
        ]


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

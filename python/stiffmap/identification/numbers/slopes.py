"""Slopes of the readings by many unknowns at once, one step each from the machine's own equilibria."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.ahead import Ahead
from stiffmap.experiment.prediction.nearby import Near
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.numbers.certificate import INSTRUMENT, SCALE, scaled
from stiffmap.identification.numbers.unknowns import Unknown
from stiffmap.model.description import MachineDescription
from stiffmap.model.with_errors import Knots, edited
from stiffmap.solve.machine import Machine

SMALL = 2e-4
"""Step, of a standard uncertainty."""
AT_ONCE = 64
"""Unknowns whose slopes are computed together."""
Moves = Mapping[tuple[str, str], float]


def moves_of(pairs: Iterable[tuple[Unknown, float]]) -> dict[tuple[str, str], float]:
    """By how much each number is off, of unknowns at values in standard uncertainties."""
    moves: dict[tuple[str, str], float] = {}
    for unknown, value in pairs:
        for place, weight in unknown.moves:
            moves[place] = moves.get(place, 0.0) + weight * unknown.u * value
    return moves


def built(predictor: Predictor, moves: Moves) -> Machine:
    """The machine with its own numbers off; the instrument's are left out."""
    return Machine(with_moves(predictor.machine.description, moves), like=predictor.machine)


def with_moves(
    description: MachineDescription, moves: Moves, travel: Mapping[str, Knots] | None = None
) -> MachineDescription:
    """The description with its own numbers off, and with axis positioning errors of its drives; the instrument's are left out."""
    own = {(at, what): by for (at, what), by in moves.items() if at != INSTRUMENT}
    return edited(description, own, travel) if own or travel else description


class Slopes:
    """Changes of the readings per standard uncertainty at some values (p,).

    Those of a set-up and of the instrument, and what one step does not lead to, are for whole predictions.
    """

    def __init__(self, predictor: Predictor, unknowns: Sequence[Unknown], values: Floats) -> None:
        self._predictor, self._unknowns = predictor, unknowns
        pairs = [(u, float(v)) for u, v in zip(unknowns, values, strict=True) if v != 0.0]
        self._here = moves_of(pairs)
        self._scale = self._here.pop((INSTRUMENT, SCALE), 0.0)
        apart = any(u.setup and not u.of_instrument for u, _ in pairs)  # a machine for each set-up
        plain = [k for k, u in enumerate(unknowns) if not u.setup and not u.of_instrument]
        self._ahead = Ahead([] if apart else plain, AT_ONCE, self._tell)

    def of(self, k: int) -> Floats | None:
        """(n, c) of unknown k; None where whole predictions are needed."""
        return self._ahead.of(k)

    def _tell(self, some: Sequence[int]) -> list[Floats | None]:
        terms = (scaled(self._predictor.machine.description, self._scale),) if self._scale else ()
        near = {k: n for k in some if (n := self._near(self._unknowns[k]))}
        told = dict(zip(near, self._base.changes_of_machines(list(near.values()), terms), strict=True))
        return [None if (change := told.get(k)) is None else change / SMALL for k in some]

    @cached_property
    def _base(self) -> Predictor:
        """Of the machine with these values."""
        base = self._predictor
        if any(at != INSTRUMENT for at, _ in self._here):
            base = base.beside(machine=built(base, self._here))
        return base

    def _near(self, u: Unknown) -> Near | None:
        """The machine with an unknown moved; None where it cannot be built: its own prediction will say why."""
        try:
            return Near(self._moved(u, SMALL), partial(self._moved, u, 0.0))
        except StiffmapError:
            return None

    def _moved(self, u: Unknown, by: float) -> MachineDescription:
        more = {place: self._here.get(place, 0.0) + weight * u.u * by for place, weight in u.moves}
        return with_moves(self._predictor.machine.description, {**self._here, **more})

"""What a diagnosis finds, piece by piece: named effects with their intervals, and the smallest that an experiment would have revealed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.calibration.result import FoundNumber
from stiffmap.identification.candidates.candidates import Candidate, words
from stiffmap.identification.inference.amplitudes import Fit
from stiffmap.identification.inference.chosen import Term
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.corrected import Corrected
from stiffmap.identification.inference.places import Place, reach
from stiffmap.identification.inference.shares import WideGroup
from stiffmap.model.description import MachineDescription
from stiffmap.model.effects import Placed, registry


@dataclass(frozen=True)
class Effect:
    """A named effect, SI."""

    kind: str
    element: str
    legs: tuple[str, ...]
    parameters: dict[str, tuple[float, float, float, str]]
    """Name -> (value, lower and upper end of the 95 % interval, unit)."""
    aliases: list[dict[str, Any]]
    """Kind, element, legs of what this plan cannot distinguish from it."""
    evidence: dict[str, float]
    definition: str = ""
    """Definition, pivot, frame and what moves with it."""
    open_ends: tuple[str, ...] = ()
    """Ends of intervals that were not found, as ``scale upper``: the machine cannot be solved beyond them, or the
    readings hardly change; the number given is then no limit."""

    @property
    def place(self) -> tuple[str, str, tuple[str, ...]]:
        """Kind, element, legs."""
        return (self.kind, self.element, self.legs)

    def __str__(self) -> str:
        values = "; ".join(
            f"{n} {v:.5g} [{a:.5g}, {b:.5g}] {u}" for n, (v, a, b, u) in self.parameters.items()
        )
        return f"{words(*self.place)}: {values}"


@dataclass(frozen=True)
class Rest:
    """What nobody can name: smooth gaps, common errors of a pose, noise that is larger than declared."""

    what: str
    share: float
    """Of the squares of all readings' difference from the declared machine."""
    axis: str = ""
    """Where it is largest, in noise."""
    position: tuple[float, float, float] | None = None
    """Commanded position of the pose where it is largest, m."""
    size: float = float("nan")
    """rms of it there, m or rad."""


@dataclass(frozen=True)
class FoundNumbers:
    """What the readings say of all declared numbers together."""

    verdict: str
    """``adjusted within tolerance``, ``adjusted beyond tolerance`` or ``beyond tolerance: NAME, ...``."""
    wide: tuple[WideGroup, ...]
    """Groups that are further off than their standard uncertainties say, whichever of their numbers it is."""
    beyond: tuple[FoundNumber, ...]
    """Those that no tolerance allows, the largest share first."""
    table: tuple[FoundNumber, ...]
    """All that the readings show."""


@dataclass(frozen=True)
class NoiseReport:
    """SI, per axis read."""

    floor: dict[str, float]
    repeats: dict[str, float]
    declared: dict[str, float]
    consistency: dict[str, float]
    """p-value of repeats that differ so much from the stated noise."""
    lack_of_fit_before: float
    """p-value of what the declared machine leaves, in the noise of `scale`, where that is independent."""
    lack_of_fit_after: float
    """The same of the machine that is handed over."""
    rms: float
    scale: float = 1.0
    """Noise of the readings over `floor`, as the inference has it."""


@dataclass(frozen=True)
class Detectability:
    """Smallest size of an effect's parameters that this experiment would have revealed (95 % power)."""

    kind: str
    element: str
    legs: tuple[str, ...]
    sizes: dict[str, float | None]
    """SI change from the null value; None: not observable."""
    aliases: list[dict[str, Any]]


POWER = 0.95
"""Probability with which an effect of that size has a name."""


def effects_of(
    found: Corrected, places: Sequence[Place], evidence: Sequence[dict[str, float]]
) -> list[Effect]:
    """The effects of an optimum with their 95 % intervals, SI, at their places; `evidence` per effect."""
    description = found.given.predictor.machine.description
    return [_effect(description, *each) for each in zip(found.terms, places, evidence, strict=True)]


def _effect(description: MachineDescription, term: Term, place: Place, evidence: dict[str, float]) -> Effect:
    c, e = term.candidate, registry.get(term.candidate.kind)
    scale = np.array([[p.scale] for p in c.parameters])
    low, high = (side[:, None] for side in term.bounds)
    ends = np.stack(term.ends, axis=1)
    inside = np.clip(ends, low, high)
    rows = np.column_stack([term.values, inside]) * scale
    named = zip(c.parameters, rows.tolist(), strict=True)
    parameters = {p.name: (v, a, b, p.unit) for p, (v, a, b) in named}
    cut = [
        f"{p.name} {side}"
        for p, wide, kept in zip(c.parameters, ends, inside, strict=True)
        for side, x, y in zip(("lower", "upper"), wide, kept, strict=True)
        if x != y and (p.null is None or y * p.scale != p.null)
    ]
    return Effect(
        c.kind,
        c.element,
        c.legs,
        parameters | _derived(description, c, rows),
        [a for a in map(as_place, (*place.aliases, *place.wider)) if a != as_place(c)],
        evidence,
        f"{e.doc} Pivot: {e.pivot}. Frame: {e.frame}. Moves: {e.moves}.",
        tuple(cut),
    )


def _derived(
    description: MachineDescription, candidate: Candidate, rows: Floats
) -> dict[str, tuple[float, float, float, str]]:
    effect = registry.get(candidate.kind)
    if effect.derived is None or len(rows) != 1:
        return {}
    name = candidate.parameters[0].name
    found = [
        effect.derived(description, Placed(candidate.kind, candidate.element, candidate.legs, {name: v}, {}))
        for v in rows[0]
    ]
    at = effect.parameters_at(description, candidate.element, candidate.legs)
    units = {p.name: p.unit for p in at}
    return {
        n: (found[0][n], min(found[1][n], found[2][n]), max(found[1][n], found[2][n]), units.get(n, ""))
        for n in found[0]
    }


def as_place(candidate: Candidate) -> dict[str, object]:
    """Kind, element, legs."""
    return {"kind": candidate.kind, "element": candidate.element, "legs": list(candidate.legs)}


def detectable(columns: Columns, fit: Fit) -> list[Detectability]:
    """One entry per place: the sizes that gain the odds of a name over all places, with 95 % power, in the model that was found."""
    needed = np.sqrt(2.0 * np.log(ODDS * max(1, len(columns.places)))) - ndtri(1.0 - POWER)
    out = []
    for place in columns.places:
        sizes = _sizes(columns, fit, place, float(needed))
        if any(v is not None for v in sizes.values()):
            c = place.candidate
            out.append(Detectability(c.kind, c.element, c.legs, sizes, [as_place(a) for a in place.aliases]))
    return out


def _sizes(columns: Columns, fit: Fit, place: Place, needed: float) -> dict[str, float | None]:
    """The median over shapes (periods)."""
    linear = place.candidate.linear
    each: list[Floats] = []
    for shape in place.shapes[:: max(1, len(place.shapes) // 5)]:
        white = fit.white(columns.rotated(columns.lines(shape.variant)))
        if white.shape[1] != len(linear):
            return dict.fromkeys((p.name for p in linear), None)
        with np.errstate(divide="ignore"):
            each.append(needed / np.linalg.norm(white, axis=0))
    sizes = zip(linear, np.median(each, axis=0).tolist(), strict=True)
    return {p.name: size * p.scale if size < reach(p) else None for p, size in sizes}

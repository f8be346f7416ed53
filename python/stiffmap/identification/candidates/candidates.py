"""Candidates: every effect of the registry at every place of the machine, as far as the data allow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import EffectType, Parameter, registry
from stiffmap.model.effects.types import same_part

Names = tuple[str, ...]


@dataclass(frozen=True)
class Candidate:
    """An effect at a place with the parameters that a fit may move.

    ``options`` are words that make a kind of their own (never the branch of friction, which is a
    column of the data).
    """

    kind: str
    element: str
    legs: Names
    parameters: tuple[Parameter, ...]
    options: tuple[tuple[str, str], ...] = ()

    @property
    def place(self) -> tuple[str, str, Names]:
        """Kind, element, legs: what a verdict names."""
        return (self.kind, self.element, self.legs)

    @property
    def linear(self) -> tuple[Parameter, ...]:
        """Parameters that have a null value: those whose sensitivity at the null exists."""
        return tuple(p for p in self.parameters if p.null is not None)

    @property
    def shape(self) -> tuple[Parameter, ...]:
        """Parameters without a null value (a period, a phase): unidentified without the effect."""
        return tuple(p for p in self.parameters if p.null is None)

    def term(self, values: Sequence[float]) -> AppliedEffect:
        """The effect with these values (SI), in the order of `parameters`."""
        given = tuple((p.name, float(v)) for p, v in zip(self.parameters, values, strict=True))
        return AppliedEffect(self.kind, self.element, self.legs, given, self.options)

    def term_of(self, given: Mapping[str, float]) -> AppliedEffect:
        """The effect with some values (SI) by name, the others at their null."""
        return self.term([given.get(p.name, float(p.null or 0.0)) for p in self.parameters])

    def strengths(self, values: Floats) -> tuple[tuple[Parameter, float], ...]:
        """Linear parameters with their values, SI, of values (p,) in scales from the null; nothing where there are more or fewer."""
        if len(self.linear) != len(values):
            return ()
        return tuple(
            (p, float(p.null or 0.0) + float(v) * p.scale) for p, v in zip(self.linear, values, strict=True)
        )

    def __str__(self) -> str:
        axes = " by axis" if self.parameters[0].name == "gain_x" else ""
        return f"{words(*self.place)}{axes}"


def words(kind: str, element: str, legs: Names) -> str:
    """``compliance of actuator, leg x``."""
    of_legs = f", leg{'s' if len(legs) > 1 else ''} {', '.join(legs)}" if legs else ""
    return f"{kind} of {element}{of_legs}"


def candidates(description: MachineDescription, experiment: Experiment) -> list[Candidate]:
    """All candidates that the data can speak of at all."""
    found = []
    for kind in registry.kinds():
        effect = effects.get(kind)
        recorded = experiment.recorded.issuperset(effect.needs)
        if recorded and not (effect.hidden and effect.hidden(experiment)):
            found += of_kind(effect, description)
    return found


def of_kind(effect: EffectType, description: MachineDescription) -> list[Candidate]:
    """One candidate per place and meaning."""
    out = []
    for element, legs in (effect.tried or effect.places)(description):
        parameters = tuple(
            p
            for p in effect.parameters_at(description, element, legs)
            # fitted too: a number that must be given and that nobody gives, as the anchor of a cable
            if (
                p.name in effect.moved if effect.moved else p.fitted or (p.null is None and p.default is None)
            )
        )
        later = [p.name for p in parameters if p.name in effect.one_of][1:]
        parameters = tuple(_plausible(p) for p in parameters if p.name not in later)
        if parameters and (effect.signature or any(p.null is not None for p in parameters)):
            out += [Candidate(effect.kind, element, legs, part) for part in meanings(parameters)]
    return out


def meanings(parameters: tuple[Parameter, ...]) -> list[tuple[Parameter, ...]]:
    """The parameters, or apart the one that stands for all axes (`gain` in addition to `gain_x` …): together they
    would say the same thing twice."""
    names = {p.name for p in parameters}
    common = tuple(p for p in parameters if f"{p.name}_x" in names)
    return [common, tuple(p for p in parameters if p not in common)] if common else [parameters]


def _plausible(p: Parameter) -> Parameter:
    lower, upper = p.plausible or (p.lower, p.upper)
    return replace(p, lower=max(lower, p.lower), upper=min(upper, p.upper))


def clash(candidate: Candidate, others: Iterable[Candidate]) -> bool:
    """Whether the candidate and one of the others exclude each other at a place that they share."""
    legs = set(candidate.legs)
    shared = (o for o in others if same_part(o.element, candidate.element))
    shared = (o for o in shared if not legs or not o.legs or legs & set(o.legs))
    return any(o.kind in _excluded(candidate.kind) or candidate.kind in _excluded(o.kind) for o in shared)


@cache
def _excluded(kind: str) -> Sequence[str]:
    """Kinds that an effect excludes; a cause of a tap test that is no effect excludes none."""
    return effects.get(kind).excludes if kind in registry.kinds() else ()

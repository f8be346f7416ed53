"""Values of given effects from an experiment: least squares of whitened readings, nuisances projected out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.short import short_repr
from stiffmap.experiment.calls import Effects, as_experiment, effects_of
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.experiment.prediction.history import Terms
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.candidates import words
from stiffmap.identification.candidates.sensitivity import step_of
from stiffmap.identification.inference.optimum import covariance, optimum
from stiffmap.model import effects
from stiffmap.model.description import MachineDescription
from stiffmap.model.effects.types import Parameter
from stiffmap.solve.machine import Machine, takes_machine

STEP = 1e-3
"""Share of a parameter's typical size over which predictions are differenced."""
STEPS = 30
"""Evaluations of a fit at most."""


@short_repr
@dataclass(frozen=True, eq=False)
class Estimate:
    """Fitted values of k parameters, SI."""

    names: tuple[str, ...]
    """``kind of element, leg x: parameter``."""
    units: tuple[str, ...]
    scale: Floats
    """(k,) typical sizes."""
    values: Floats
    covariance: Floats
    """(k, k) from the noise of the readings; infinite variances of numbers that they do not determine."""
    terms: Terms
    chi2: float
    freedom: int
    """Readings less nuisances less parameters that they determine."""
    problem: LinearProblem = field(repr=False)
    jacobian: Floats = field(repr=False)
    """(N, k) change of the whitened readings per unit of each number."""
    residual: Floats = field(repr=False)
    """(N,) whitened, with the fitted values."""

    @property
    def experiment(self) -> Experiment:
        """The readings that were fitted."""
        return self.problem.experiment

    @property
    def sigma(self) -> Floats:
        """(k,) standard uncertainties by the readings' noise."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def misfit(self) -> float:
        """Root of chi-square per degree of freedom, at least 1: what a model that does not fit adds (Birge)."""
        return float(np.sqrt(max(1.0, self.chi2 / max(self.freedom, 1))))

    @property
    def worst(self) -> float:
        """The largest standard uncertainty, misfit included, in typical sizes."""
        return float((self.sigma * self.misfit / self.scale).max())

    def as_plain(self) -> list[dict[str, Any]]:
        """Data of JSON, SI: values and uncertainties."""
        each = zip(self.names, self.units, self.values, self.sigma * self.misfit, strict=True)
        return [{"name": n, "unit": s, "value": v, "u": u} for n, s, v, u in each]


@takes_machine
def estimate(machine: Machine, experiment: Experiment | str | PathLike[str], terms: Effects) -> Estimate:
    """Values of `terms`, which say effects, places and the values to start from.

    Raises StiffmapError for terms without a number to fit and for noise that is unknown.
    """
    begun = tuple(effects_of(machine, terms, "terms"))
    if not (parameters := fitted(machine.description, begun)):
        raise StiffmapError("terms: expected at least one effect with a number to fit, got none")
    predictor = Predictor(machine, as_experiment(experiment))
    e = predictor.experiment
    problem = LinearProblem.of(e, noise_of(e).sigma, predictor())
    scale, low, high = (np.array([getattr(p, s) for _, p in parameters]) for s in ("scale", "lower", "upper"))

    def at(x: Floats) -> Terms:
        return with_values(begun, parameters, x * scale)

    def columns(x: Floats) -> Floats:
        return -problem.white(slopes(predictor, at(x), parameters) * scale)

    begin, bounds = values_of(begun, parameters) / scale, (low / scale, high / scale)
    found = optimum(lambda x: problem.residual(predictor(at(x))), begin, bounds, columns, STEPS)
    spread, rank = covariance(found.jacobian)
    return Estimate(
        names_of(begun, parameters),
        tuple(p.unit for _, p in parameters),
        scale,
        found.x * scale,
        spread * np.outer(scale, scale),
        at(found.x),
        found.chi2,
        problem.freedom - rank,
        problem,
        -found.jacobian / scale,
        found.residual,
    )


def fitted(description: MachineDescription, terms: Terms) -> list[tuple[int, Parameter]]:
    """Numbers of the terms that may be fitted: index of the term, and the parameter at its place."""
    out = []
    for i, t in enumerate(terms):
        declared = description.declared or description
        known = effects.get(t.kind).parameters_at(declared, t.element, t.legs)
        given = dict(t.parameters)
        out += [(i, p) for p in known if p.name in given and p.fitted]
    return out


def names_of(terms: Terms, parameters: list[tuple[int, Parameter]]) -> tuple[str, ...]:
    """``kind of element, leg x: parameter`` of each."""
    return tuple(f"{words(t.kind, t.element, t.legs)}: {p.name}" for i, p in parameters for t in [terms[i]])


def values_of(terms: Terms, parameters: list[tuple[int, Parameter]]) -> Floats:
    """(k,) values of the parameters in the terms."""
    return np.array([dict(terms[i].parameters)[p.name] for i, p in parameters])


def with_values(terms: Terms, parameters: list[tuple[int, Parameter]], values: Floats) -> Terms:
    """The terms with other values (k,)."""
    given = [dict(t.parameters) for t in terms]
    for (i, p), v in zip(parameters, values, strict=True):
        given[i][p.name] = float(v)
    return tuple(replace(t, parameters=tuple(g.items())) for t, g in zip(terms, given, strict=True))


def slopes(predictor: Predictor, terms: Terms, parameters: list[tuple[int, Parameter]]) -> Floats:
    """(n, c, k) change of the readings per unit of each parameter: by one step from the equilibria with the terms, or, where that does
    not hold, by differences of whole predictions, inside the bounds."""
    x = values_of(terms, parameters)

    def at(k: int, value: float) -> Terms:
        return with_values(terms, parameters, np.where(np.arange(len(x)) == k, value, x))

    ahead = [
        v + h if v + (h := step_of(p)) <= p.upper else v - h for v, (_, p) in zip(x, parameters, strict=True)
    ]
    near = predictor.changes([at(k, v) for k, v in enumerate(ahead)], terms)
    out = np.zeros((*predictor.experiment.reading.shape, len(x)))
    for k, (change, (_, p)) in enumerate(zip(near, parameters, strict=True)):
        if change is not None:
            out[..., k] = change / (ahead[k] - x[k])
            continue
        high, low = min(x[k] + STEP * p.scale, p.upper), max(x[k] - STEP * p.scale, p.lower)
        out[..., k] = (predictor(at(k, high)) - predictor(at(k, low))) / (high - low)
    return np.nan_to_num(out)

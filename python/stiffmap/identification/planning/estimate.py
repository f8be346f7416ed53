"""Values of given effects from an experiment: Gauss-Newton on whitened readings, nuisances projected out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import short_repr
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects.types import Parameter
from stiffmap.solve.machine import Machine

STEP = 1e-3
"""Share of a parameter's typical size over which predictions are differenced."""
STEPS, DONE = 15, 1e-6
RANK, FELT = 1e-8, 1e-6
"""Singular values of the columns in typical sizes, relative to the largest, below which a direction is not identifiable; the
share of a number in such directions from which on it is not."""
Terms = tuple[AppliedEffect, ...]


@short_repr
@dataclass(frozen=True, eq=False)
class Estimate:
    """Fitted values of k parameters, SI."""

    names: tuple[str, ...]
    """``kind of element, leg x: parameter``."""
    units: tuple[str, ...]
    values: Floats
    covariance: Floats
    """(k, k) from the noise of the readings; infinite variances of numbers that they do not determine."""
    terms: Terms
    chi2: float
    freedom: int
    """Readings less nuisances less parameters that they determine."""
    problem: Problem = field(repr=False)
    jacobian: Floats = field(repr=False)
    """(N, k) change of the whitened readings per unit of each number."""
    residual: Floats = field(repr=False)
    """(N,) whitened, with the fitted values."""
    left: Floats = field(repr=False)
    """(n, c) m, rad: reading minus prediction, less unknown frames and zeros."""

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


def estimate(machine: Machine, experiment: Experiment, terms: Sequence[AppliedEffect]) -> Estimate:
    """Values of `terms`, which say effects, places and the values to start from.

    Raises StiffmapError for terms without a number to fit and for noise that is unknown.
    """
    predictor = Predictor(machine, experiment)
    e, begun = predictor.experiment, tuple(terms)
    problem = Problem.of(e, noise_of(e).sigma, predictor())
    parameters = fitted(machine.description, begun)
    x = values_of(begun, parameters)
    low, high = (np.array([getattr(p, side) for _, p in parameters]) for side in ("lower", "upper"))
    residual = problem.residual(predictor(begun))
    jacobian = np.zeros((len(problem), len(x)))
    for _ in range(STEPS):
        jacobian = np.column_stack([problem.white(c) for c in slopes(predictor, begun, parameters)])
        scale = np.array([p.scale for _, p in parameters])
        step = np.linalg.lstsq(jacobian * scale, residual, rcond=RANK)[0] * scale
        x, moved, residual = _shortened(predictor, problem, begun, parameters, x, step, residual, (low, high))
        begun = with_values(begun, parameters, x)
        if not moved > DONE:
            break
    scale = np.array([p.scale for _, p in parameters])
    covariance, rank = _covariance(jacobian * scale)
    covariance = covariance * np.outer(scale, scale)
    freedom = problem.freedom - rank
    names = tuple(f"{_place(begun[i])}: {p.name}" for i, p in parameters)
    units = tuple(p.unit for _, p in parameters)
    left = e.reading - predictor(begun)
    left = left - nuisance_part(problem, left)
    return Estimate(
        names,
        units,
        x,
        covariance,
        begun,
        float(residual @ residual),
        freedom,
        problem,
        jacobian,
        residual,
        left,
    )


def _covariance(jacobian: Floats) -> tuple[Floats, int]:
    """(k, k) of the numbers with columns (n, k), infinite variances of those that the readings do not determine; the rank."""
    _, size, v = np.linalg.svd(jacobian, full_matrices=len(jacobian) < jacobian.shape[1])
    size = np.append(size, np.zeros(len(v) - len(size)))
    told = size > RANK * size.max(initial=0.0)
    out: Floats = (v[told].T / size[told] ** 2) @ v[told]
    untold = np.flatnonzero(np.linalg.norm(v[~told], axis=0) > FELT)
    out[untold, untold] = np.inf
    return out, int(told.sum())


def _shortened(
    predictor: Predictor,
    problem: Problem,
    terms: Terms,
    parameters: list[tuple[int, Parameter]],
    x: Floats,
    step: Floats,
    residual: Floats,
    bounds: tuple[Floats, Floats],
) -> tuple[Floats, float, Floats]:
    """The step, halved until it pays; how far it went in typical sizes."""
    scale = np.array([p.scale for _, p in parameters])
    for _ in range(6):
        tried = np.clip(x + step, *bounds)
        new = problem.residual(predictor(with_values(terms, parameters, tried)))
        if new @ new <= residual @ residual:
            return tried, float(np.abs((tried - x) / scale).max(initial=0.0)), new
        step = step / 2
    return x, 0.0, residual


def fitted(description: MachineDescription, terms: Terms) -> list[tuple[int, Parameter]]:
    """Numbers of the terms that may be fitted: index of the term, and the parameter at its place."""
    out = []
    for i, t in enumerate(terms):
        declared = description.declared or description
        known = effects.get(t.kind).parameters_at(declared, t.element, t.legs)
        given = dict(t.parameters)
        out += [(i, p) for p in known if p.name in given and p.fitted]
    return out


def values_of(terms: Terms, parameters: list[tuple[int, Parameter]]) -> Floats:
    """(k,) values of the parameters in the terms."""
    return np.array([dict(terms[i].parameters)[p.name] for i, p in parameters])


def with_values(terms: Terms, parameters: list[tuple[int, Parameter]], values: Floats) -> Terms:
    """The terms with other values (k,)."""
    given = [dict(t.parameters) for t in terms]
    for (i, p), v in zip(parameters, values, strict=True):
        given[i][p.name] = float(v)
    return tuple(replace(t, parameters=tuple(g.items())) for t, g in zip(terms, given, strict=True))


def slopes(predictor: Predictor, terms: Terms, parameters: list[tuple[int, Parameter]]) -> list[Floats]:
    """(n, c) change of the readings per unit of each parameter, by central differences inside its bounds."""
    x = values_of(terms, parameters)
    out = []
    for k, (_, p) in enumerate(parameters):
        ahead, behind = x.copy(), x.copy()
        ahead[k] = min(x[k] + STEP * p.scale, p.upper)
        behind[k] = max(x[k] - STEP * p.scale, p.lower)
        up, down = (predictor(with_values(terms, parameters, v)) for v in (ahead, behind))
        out.append(np.nan_to_num((up - down) / (ahead[k] - behind[k])))
    return out


def _place(t: AppliedEffect) -> str:
    legs = f", leg{'s' if len(t.legs) > 1 else ''} {', '.join(t.legs)}" if t.legs else ""
    return f"{t.kind} of {t.element}{legs}"

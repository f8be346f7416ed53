"""Weighted nonlinear least squares through the full equilibrium.

Gauss–Newton with bounds; the Jacobian comes from differences once and is kept up to date by Broyden's
rank-one formula, since readings are nearly linear in the parameters and predictions are what costs.
It is taken afresh where a step does not pay or the fit was not nearly linear.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.diagnosis.candidates.slopes import step_at
from stiffmap.identification.diagnosis.fitting.model import Model, tangent_step
from stiffmap.identification.diagnosis.fitting.tangents import (
    best_known,
    keep,
    keep_best,
    known_before,
    known_jacobian,
)

PAYS = 1e-3
"""Change of chi-square, per what a reading leaves where that is more than noise, that is not worth another step."""
STEPS, FRESH = 12, 3
BENT = 0.05
"""Share of a step's change by which a borrowed Jacobian may be wrong."""
DAMPING = 0.01
"""Levenberg's term, per scale: a parameter that the readings hardly feel stays where it is."""

Residual = Callable[[Floats], Floats]


class GivenUpError(StiffmapError):
    """A fit's predictions are too dear to go on: their equilibria fail, or leave the kernels."""


def fit(
    model: Model,
    predictor: Predictor,
    problem: Problem,
    *,
    fixed: Sequence[int] = (),
    near: Floats | None = None,
    doubtful: Sequence[int] = (),
    pays: float = PAYS,
) -> Model:
    """The model with the values that minimise chi-square; `fixed` indices stay.

    near
        (N, k) Jacobian of somewhere near, to begin with instead of differences; it serves as long as it
        foretells what steps do. Slopes that an earlier fit of the same effects has left go before it.
    doubtful
        Values, the last effect's, whose columns of `near` are taken anew first where it does not.
    pays
        Change of chi-square that is worth another step.

    Its residual and Jacobian belong to these values. Where the machine cannot be built or solved with
    them chi2 is infinite, residual and Jacobian are None and `problem` says why; values stay within
    their bounds. So it is where the fit is given up for its effort (`Predictor.patience`).
    """
    free = np.array([i for i in range(len(model.values)) if i not in {*fixed, *model.held}], dtype=np.intp)
    model = replace(model, values=np.clip(model.values, *model.bounds()))
    try:
        found = _descend(
            model, predictor, problem, free, None if near is None else near[:, free], doubtful, pays
        )
    except StiffmapError as error:
        given_up = isinstance(error, GivenUpError)
        return replace(
            model, chi2=np.inf, residual=None, jacobian=None, failure=str(error), given_up=given_up
        )
    if not fixed:
        keep_best(found, predictor)
    return found


def fit_without(model: Model, i: int, predictor: Predictor, problem: Problem) -> Model:
    """The fit of a fitted model less one candidate."""
    near = None if model.jacobian is None else np.delete(model.jacobian, model.parts()[i], axis=1)
    less = model.without(i)
    before = best_known(less, predictor)
    return fit(less if before is None else replace(less, values=before), predictor, problem, near=near)


def evaluate(model: Model, predictor: Predictor, problem: Problem) -> Model:
    """Residual, Jacobian and chi2 of the model as it is."""
    r = problem.residual(predictor(model.terms()))
    free = np.array([i for i in range(len(model.values)) if i not in model.held], dtype=np.intp)
    j = np.zeros((len(r), len(model.values)))
    j[:, free] = jacobian(model, model.values, predictor, problem, free)
    return replace(model, chi2=float(r @ r), residual=r, jacobian=j)


def _descend(
    model: Model,
    predictor: Predictor,
    problem: Problem,
    free: NDArray[np.intp],
    near: Floats | None,
    doubtful: Sequence[int] = (),
    pays: float = PAYS,
) -> Model:
    low, high = model.bounds()
    x = model.values
    most = predictor.effort + predictor.patience

    def residual(values: Floats) -> Floats:
        _go_on(predictor, most)
        return problem.residual(predictor(model.terms(values)))

    def tried_residual(values: Floats) -> Floats:
        """A step to where the machine cannot be built is one that does not pay."""
        try:
            return residual(values)
        except GivenUpError:
            raise
        except StiffmapError:
            return np.full(len(problem), np.inf)

    r = residual(x)
    known = known_jacobian(model, x, r, predictor, problem, free) if free.size else None
    if known is not None:  # as good as fresh
        near, j, age = None, known[:, free], 0
    else:
        j, age = (jacobian(model, x, predictor, problem, free, most), 0) if near is None else (near, 1)
    for _ in range(STEPS if free.size else 0):
        enough = pays * max(1.0, float(r @ r) / max(len(r), 1))
        step = np.zeros_like(x)
        step[free] = _bounded(j, r, (low - x)[free], (high - x)[free])
        if promised(j, r, step[free]) < enough:
            break
        moved, tried = _shorten(tried_residual, x, step, r)
        gain = float(r @ r - tried @ tried)
        if near is not None and not _foretold(j, r, tried, (moved - x)[free]):
            x, r = moved, tried
            again = np.isin(free, doubtful)
            if again.any() and not again.all():
                j, age, doubtful = j.copy(), 1, ()
                j[:, again] = jacobian(model, x, predictor, problem, free[again], most)
                continue
            near, age = None, 0
            j = jacobian(model, x, predictor, problem, free, most)
            continue
        if gain > 0:
            s = (moved - x)[free]
            j, x, r, age = j + np.outer(tried - r - j @ s, s) / (s @ s), moved, tried, age + 1
        if gain > enough and age < FRESH:
            continue
        if age == 0 or (gain <= enough and age < 2):
            break
        j, age = jacobian(model, x, predictor, problem, free, most), 0
    full = np.zeros((len(r), len(x)))
    full[:, free] = j
    return replace(model, values=x, chi2=float(r @ r), residual=r, jacobian=full, failure="")


def _bounded(j: Floats, r: Floats, low: Floats, high: Floats) -> Floats:
    """Step that minimises |r + J step| within the bounds."""
    norm = np.linalg.norm(j, axis=0)
    unit = np.where(norm > 0, norm, 1.0)
    margin = 1e-12 * (1.0 + np.abs(low) + np.abs(high))
    damped = np.vstack([j / unit, np.diag(DAMPING / unit)])
    found = lsq_linear(
        damped,
        -np.append(r, np.zeros(len(norm))),
        (np.minimum(low, 0) * unit - margin, np.maximum(high, 0) * unit + margin),
    )
    return np.asarray(np.clip(found.x / unit, low, high))


def _foretold(j: Floats, r: Floats, tried: Floats, step: Floats) -> bool:
    """Whether a Jacobian predicted what a step did, to within `BENT` of it."""
    told = j @ step
    return float(np.linalg.norm(tried - r - told)) <= BENT * float(np.linalg.norm(told)) + float(
        np.sqrt(PAYS)
    )


def promised(j: Floats, r: Floats, step: Floats) -> float:
    """Drop of chi-square that the linear model promises of a step."""
    return float(r @ r - np.sum((r + j @ step) ** 2))


def _shorten(residual: Residual, x: Floats, step: Floats, r: Floats) -> tuple[Floats, Floats]:
    """The step, halved until it does not make things worse; the old place where none helps."""
    before = float(r @ r)
    for _ in range(4):
        moved = x + step
        tried = residual(moved)
        if float(tried @ tried) < before:
            return moved, tried
        step = step / 2
    return x, r


def _go_on(predictor: Predictor, most: float) -> None:
    """Raises `GivenUpError` beyond so much effort."""
    if predictor.effort > most:
        raise GivenUpError("given up: its predictions fail or leave the fast path")


def jacobian(
    model: Model,
    values: Floats,
    predictor: Predictor,
    problem: Problem,
    which: NDArray[np.intp],
    most: float = np.inf,
) -> Floats:
    """(N, len(which)) change of the whitened residual per unit of each value; `GivenUpError` beyond an effort of `most`."""
    here = problem.check(predictor(model.terms(values)))
    _, high = model.bounds()
    numbers = [int(i) for i in which]
    slopes: dict[int, Floats] = {}
    if len(numbers) > 1:  # one alone costs as much by a prediction
        _go_on(predictor, most)
        slopes = _told(model, values, predictor, numbers)
    for i in numbers:
        if i not in slopes:
            _go_on(predictor, most)
            there, step = _beside(model, values, i, tangent_step(values, i, high[i]), predictor, problem)
            slopes[i] = (there - here) / step
    all_felt = len(values) - len(model.held)
    known = slopes if len(slopes) == all_felt else {**known_before(model, predictor), **slopes}
    if len(known) == all_felt > 0:
        keep(model, values, predictor, here, known)
    columns = [-problem.white(slopes[i]) for i in numbers]
    return np.column_stack(columns) if columns else np.zeros((len(problem), 0))


def _told(model: Model, values: Floats, predictor: Predictor, numbers: Sequence[int]) -> dict[int, Floats]:
    """Slopes of the predictions by those of the values that one step from the equilibria gives, per unit of each."""
    _, high = model.bounds()
    parameters, steps = model.parameters, dict[int, float]()
    for i in numbers:
        size = step_at(parameters[i], values[i] * parameters[i].scale)
        if size is not None:
            steps[i] = tangent_step(values, i, high[i], size / parameters[i].scale)
    moved = [model.terms(_moved(values, i, step)) for i, step in steps.items()]
    changes = predictor.changes(moved, model.terms(values)) if moved else []
    return {i: c / steps[i] for i, c in zip(steps, changes, strict=True) if c is not None}


def _beside(
    model: Model, values: Floats, i: int, step: float, predictor: Predictor, problem: Problem
) -> tuple[Floats, float]:
    """Prediction with value i moved by the step, or by its opposite where the machine cannot be built or solved."""
    low, _ = model.bounds()
    try:
        return problem.check(predictor(model.terms(_moved(values, i, step)))), step
    except StiffmapError:
        back = _moved(values, i, -step)
        if back[i] < low[i]:
            raise
        return problem.check(predictor(model.terms(back))), -step


def _moved(values: Floats, i: int, step: float) -> Floats:
    moved = values.copy()
    moved[i] += step
    return moved

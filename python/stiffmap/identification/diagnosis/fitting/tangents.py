"""Slopes of predictions that are known from earlier fits of the same effects.

Rows, noise floors and what is uncertain change from one search to the next, and with them every whitened residual; what
the machine does, and how that changes with an effect's values, does not.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.diagnosis.fitting.model import Model

TRIFLE = 0.03
"""Change of a whitened residual that nothing depends on."""
STRAIGHT = 0.02
"""Share of the change between two places by which slopes of one may miss the other."""


@dataclass(frozen=True, eq=False)
class Tangent:
    """Predictions around a place."""

    at: Floats
    """(k,) values, in scales, with each candidate's in the order of `key_of`."""
    prediction: Floats
    """(n, c) there."""
    columns: Floats
    """(n, c, k) change of the prediction per scale."""
    best: Floats
    """(k,) where the last fit ended."""


def keep(
    model: Model, values: Floats, predictor: Predictor, prediction: Floats, columns: dict[int, Floats]
) -> None:
    """Keep the slopes (n, c) of some of the values of a model; the others have none."""
    order = _order(model)
    none = np.zeros_like(prediction)
    stack = np.stack([columns.get(int(i), none) for i in order], axis=-1)
    found = Tangent(values[order], prediction, stack, values[order])
    predictor.tangents.put(key_of(model), found, stack.nbytes + prediction.nbytes)


def keep_best(model: Model, predictor: Predictor) -> None:
    """Keep where a fit ended."""
    known = predictor.tangents.get(key_of(model))
    if known is not None:
        predictor.tangents.put(
            key_of(model),
            replace(known, best=model.values[_order(model)]),
            known.columns.nbytes + known.prediction.nbytes,
        )


def best_known(model: Model, predictor: Predictor) -> Floats | None:
    """(k,) where the last fit of the same effects ended; None: there was none."""
    known = predictor.tangents.get(key_of(model))
    return None if known is None else np.asarray(known.best[np.argsort(_order(model))])


def known_before(model: Model, predictor: Predictor) -> dict[int, Floats]:
    """(n, c) slopes that are known of the model without its last effect, by the numbers of the values; none: nothing."""
    less = model.without(len(model.candidates) - 1)
    known: Tangent | None = predictor.tangents.get(key_of(less))
    if known is None:
        return {}
    back = np.argsort(_order(less))
    return {i: known.columns[..., k] for i, k in enumerate(back) if i not in less.held}


def known_jacobian(
    model: Model,
    values: Floats,
    residual: Floats,
    predictor: Predictor,
    problem: Problem,
    free: NDArray[np.intp],
) -> Floats | None:
    """(N, k) whitened slopes of a place that foretell the `residual` (N,) at `values` (k,); None where there are none."""
    known: Tangent | None = predictor.tangents.get(key_of(model))
    if known is None:
        return None
    back = np.argsort(_order(model))
    columns, at = known.columns[..., back], known.at[back]
    try:
        there = problem.residual(known.prediction)
    except StiffmapError:
        return None
    slopes = -problem.white(columns)
    if not np.isfinite(slopes).all() or not np.any(slopes[:, free] != 0.0, axis=0).all():
        return None
    told = slopes @ (values - at)
    missed = float(np.linalg.norm(residual - there - told))
    return slopes if missed <= STRAIGHT * float(np.linalg.norm(told)) + TRIFLE else None


def key_of(model: Model) -> Hashable:
    """The effects in whatever order, and the values that no fit moves."""
    held = tuple(sorted(_names(model)[i] for i in model.held))
    return frozenset(model.candidates), held


def _names(model: Model) -> list[tuple[str, str]]:
    return [(str(c), p.name) for c in model.candidates for p in c.parameters]


def _order(model: Model) -> NDArray[np.intp]:
    """Numbers of the values, sorted by the names of their candidates."""
    names = [repr((c.place, c.options, str(c))) for c in model.candidates for _ in c.parameters]
    return np.array(sorted(range(len(names)), key=lambda i: (names[i], i)), dtype=np.intp)

"""Effects with a number that the experiment records, such as a temperature.

Solved at three values of the record and interpolated between them. Growth by heat is a strain of about 1e-5 per
kelvin; what a parabola through three temperatures leaves out is of third order in it, far below any reading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import registry

Terms = tuple[AppliedEffect, ...]
Solve = Callable[[Experiment, Terms], Floats]


def records_of(terms: Sequence[AppliedEffect]) -> list[str]:
    """Columns of an experiment that give numbers of these effects."""
    return sorted({p.recorded for t in terms for p in registry.get(t.kind).parameters if p.recorded})


def change_of(experiment: Experiment, column: str) -> Floats:
    """(n,) change of a column against its reference: the file's for temperatures, else the first reading."""
    values = getattr(experiment, column)
    if values is None:
        raise StiffmapError(f"{experiment.name}: missing column '{column}'")
    reference = experiment.reference_temperature if column == "temperature" else None
    return np.asarray(values - (float(values[0]) if reference is None else reference))


def at_records(plan: Experiment, terms: Terms, solve: Solve, columns: Sequence[str] | None = None) -> Floats:
    """(n, c) motions with every row at its own record."""
    left = records_of(terms) if columns is None else columns
    if not left:
        return solve(plan, terms)
    column, *others = left
    change = change_of(plan, column)
    low, high = float(change.min()), float(change.max())
    nodes = np.array([low, (low + high) / 2, high]) if high - low > 1e-9 else np.array([low])
    solved = [
        at_records(plan, tuple(_recorded(t, column, float(node)) for t in terms), solve, others)
        for node in nodes
    ]
    weights = [_lagrange(change, nodes, i) for i in range(len(nodes))]
    return np.asarray(sum(w[:, None] * s for w, s in zip(weights, solved, strict=True)))


def _lagrange(x: Floats, nodes: Floats, i: int) -> Floats:
    others = np.delete(nodes, i)
    return np.asarray(np.prod((x[:, None] - others) / (nodes[i] - others), axis=1))


def _recorded(term: AppliedEffect, column: str, value: float) -> AppliedEffect:
    mine = {p.name: value for p in registry.get(term.kind).parameters if p.recorded == column}
    return replace(term, parameters=tuple({**dict(term.parameters), **mine}.items())) if mine else term

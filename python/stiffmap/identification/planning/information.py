"""What every candidate row adds: information matrices of wanted numbers and of all that is unknown next to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Integers
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.noise.whitening import LinearProblem
from stiffmap.experiment.prediction.history import Terms
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.experiment.virtual.plans import plan_of_poses
from stiffmap.identification.inference.optimum import covariance
from stiffmap.identification.planning.estimate import fitted, names_of, slopes
from stiffmap.solve.machine import Machine

RIDGE = 1e-9
"""Information of a parameter per typical size that no row has to bring: makes the first rows comparable."""
PASSES = 3
Value = Callable[[Floats], Floats]
"""Worth (...) of information matrices (..., k, k)."""


class Information:
    """Information matrices of all candidate rows: a signal to be separated, parameters in typical sizes, then nuisances."""

    def __init__(self, machine: Machine, plan: Experiment, terms: Terms, rival: Terms = ()) -> None:
        predictor = Predictor(machine, plan)
        self.plan, self.base = predictor.experiment, predictor()
        if len(self.plan) != len(plan):
            raise StiffmapError(f"{self.plan.name}: {self.plan.out_of_reach[0]}")
        known = rival or terms
        parameters = fitted(machine.description, known)
        if not parameters:
            raise StiffmapError("plan: the effects have no number that could be fitted")
        self.names = names_of(known, parameters)
        self.units = tuple(p.unit for _, p in parameters)
        self.scale = np.array([p.scale for _, p in parameters])
        self.columns = slopes(predictor, known, parameters) * self.scale
        sigma = np.where(self.plan.read, self.plan.sigma, np.inf)[..., None]
        own, open_ = (
            np.nan_to_num(c / sigma) for c in (self.columns, nuisance_columns(self.plan, self.base))
        )
        parts = [own, open_ / np.maximum(np.linalg.norm(open_, axis=(0, 1)), 1e-300)]
        if rival:
            parts.insert(0, np.nan_to_num((predictor(terms) - predictor(rival))[..., None] / sigma))
        x = np.concatenate(parts, axis=-1)
        self.wanted: int = parts[0].shape[-1]
        self.matrices: Floats = np.einsum("nca,ncb->nab", x, x)

    def sigma(self, rows: Integers) -> Floats:
        """(k,) standard uncertainties that a fit to some rows will have, SI; inf where they do not determine a parameter."""
        e = self.plan.rows(rows)
        white = LinearProblem.of(e, e.sigma, self.base[rows]).white(self.columns[rows])
        return np.asarray(np.sqrt(np.diag(covariance(white)[0])) * self.scale)


def information_of(m: Floats, wanted: int, prior: float = RIDGE) -> Floats:
    """log det of the information on the first numbers, the others unknown, of information matrices (..., k, k) and a prior that each
    number has by itself."""
    whole = m + prior * np.eye(m.shape[-1])
    return np.asarray(np.linalg.slogdet(whole)[1] - np.linalg.slogdet(whole[..., wanted:, wanted:])[1])


def of_map(m: Floats, weight: Floats) -> Floats:
    """Minus the mean variance of a map, by its weight (k, k) on the first numbers."""
    k = len(weight)
    spread = np.linalg.inv(m + RIDGE * np.eye(m.shape[-1]))[..., :k, :k]
    return np.asarray(-np.einsum("...kl,lk->...", spread, weight))


def map_weight(
    machine: Machine, terms: Terms, at: Floats | None, load: Floats | None, force: float
) -> Floats:
    """(k, k) mean over the map of the squared change of the tool's position per parameter (typical sizes)."""
    name = "position"
    if at is None:
        name = "position (not given: corners of the workspace)"
        low, high = machine.workspace
        inside = np.stack([low + 0.02 * (high - low), high - 0.02 * (high - low)])
        at = np.array(np.meshgrid(*inside.T, indexing="ij")).reshape(3, -1).T
    wrench = np.array([force, 0, 0, 0, 0, 0]) if load is None else load
    poses = replace(plan_of_poses(machine, "deflection", at, wrench[None]), name=name)
    there = Information(machine, poses, terms)
    columns = there.columns[:, :3]
    return np.asarray(np.einsum("nak,nal->kl", columns, columns) / len(columns))


def exchange(
    matrices: Floats, start: Floats, free: Integers, rows: int, value: Value, passes: int = PASSES
) -> Integers:
    """Indices of the rows chosen: greedily, then exchanged while that gains, in so many passes."""
    left = [int(i) for i in free]
    picked: list[int] = []
    total = start.copy()
    for _ in range(rows):
        best = left[int(np.argmax(value(total + matrices[left])))]
        picked.append(best)
        left.remove(best)
        total = total + matrices[best]
    for _ in range(passes):
        changed = False
        for place, old in enumerate(picked):
            bare = total - matrices[old]
            options = [old, *left]
            scores = value(bare + matrices[options])
            k = int(np.argmax(scores))
            if k and scores[k] > scores[0] + 1e-9 * (1 + abs(scores[0])):
                new = options[k]
                picked[place] = new
                left.remove(new)
                left.append(old)
                total, changed = bare + matrices[new], True
        if not changed:
            break
    return np.array(picked, dtype=np.intp)

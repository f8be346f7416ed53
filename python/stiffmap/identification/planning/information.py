"""What every candidate row tells: information matrices of parameters and nuisances, and what they are worth."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.experiment.virtual.plans import plan_of_poses
from stiffmap.identification.planning.estimate import fitted, slopes
from stiffmap.identification.planning.exchange import Value
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine

RIDGE = 1e-9
"""Information of a parameter per typical size that no row has to bring: makes the first rows comparable."""


class Information:
    """Information matrices of all candidate rows: parameters in typical sizes, then nuisances, then a signal."""

    def __init__(self, machine: Machine, plan: Experiment, terms: tuple[AppliedEffect, ...]) -> None:
        self.predictor, self.terms, self.signal = Predictor(machine, plan), terms, False
        if len(self.predictor.experiment) != len(plan):
            raise StiffmapError(f"plan: {self.predictor.experiment.out_of_reach[0]}")
        parameters = fitted(machine.description, terms)
        if not parameters:
            raise StiffmapError("plan: the effects have no number that could be fitted")
        self.names = tuple(
            f"{terms[i].kind} of {terms[i].element} {' '.join(terms[i].legs)}: {p.name}"
            for i, p in parameters
        )
        self.units = tuple(p.unit for _, p in parameters)
        self.scale = np.array([p.scale for _, p in parameters])
        columns = [
            c * p.scale
            for c, (_, p) in zip(slopes(self.predictor, terms, parameters), parameters, strict=True)
        ]
        base = self.predictor()
        nuisances = nuisance_columns(self.predictor.experiment, base)
        self.columns = np.concatenate([np.stack(columns, axis=-1), nuisances], axis=-1)
        self.matrices = self._products()

    def _products(self) -> Floats:
        sigma = np.where(self.predictor.experiment.read, self.predictor.experiment.sigma, np.inf)
        x = np.nan_to_num(self.columns / sigma[..., None])
        norm = np.linalg.norm(x.reshape(-1, x.shape[-1]), axis=0)
        k = len(self.names)
        norm[:k] = 1.0
        norm[-1] = 1.0 if self.signal else norm[-1]
        x = x / np.where(norm > 0, norm, 1.0)
        return np.asarray(np.einsum("nca,ncb->nab", x, x))

    def add_signal(self, terms: tuple[AppliedEffect, ...]) -> None:
        """The first explanation's signal as a last column."""
        signal = self.predictor(terms) - self.predictor(self.terms)
        self.columns = np.concatenate([self.columns, signal[..., None]], axis=-1)
        self.signal = True
        self.matrices = self._products()

    def _regular(self, m: Floats) -> Floats:
        return np.asarray(m + RIDGE * np.eye(m.shape[-1]))

    def identify(self, m: Floats) -> Floats:
        """log det of the parameters' information, nuisances unknown."""
        k = len(self.names)
        r = self._regular(m)
        whole = np.linalg.slogdet(r)[1]
        return np.asarray(whole - np.linalg.slogdet(r[..., k:, k:])[1])

    def separate(self, m: Floats) -> Floats:
        """Squared standard deviations that the rival's best fit leaves of the signal."""
        g, b, d = m[..., :-1, :-1], m[..., :-1, -1], m[..., -1, -1]
        size = np.maximum(np.einsum("...ii->...i", g), 1e-300) ** -0.5
        scaled = g * size[..., :, None] * size[..., None, :] + RIDGE * np.eye(g.shape[-1])
        found = np.linalg.solve(scaled, (b * size)[..., None])[..., 0]
        return np.asarray(d - np.einsum("...i,...i->...", b * size, found))

    def map_of(self, weight: Floats) -> Value:
        """Minus the mean variance of the map."""
        k = len(self.names)

        def value(m: Floats) -> Floats:
            covariance = np.linalg.inv(self._regular(m))[..., :k, :k]
            return np.asarray(-np.einsum("...kl,lk->...", covariance, weight))

        return value

    def sigma(self, m: Floats) -> Floats:
        """(k,) standard uncertainties, SI; inf where the rows do not determine a parameter."""
        k = len(self.names)
        m = m[:-1, :-1] if self.signal else m
        values, vectors = np.linalg.eigh(self._regular(m))
        weak = values < 1e3 * RIDGE * max(1.0, values[-1] * 1e-6)
        spread = (vectors**2 / values).sum(axis=1)[:k]
        lost = (vectors[:k, weak] ** 2).sum(axis=1) > 1e-6
        return np.asarray(np.where(lost, np.inf, np.sqrt(spread) * self.scale))

    def in_natural_unit(self, aim: str, score: float) -> float:
        """The score in its natural unit."""
        return float(score) if aim == "identify" else float(np.sqrt(abs(score)))


def map_weight(
    machine: Machine, terms: tuple[AppliedEffect, ...], at: Floats | None, load: Floats | None, force: float
) -> Floats:
    """(k, k) mean over the map of the squared change of the tool's position per parameter (typical sizes)."""
    if at is None:
        low, high = machine.workspace
        inside = np.stack([low + 0.02 * (high - low), high - 0.02 * (high - low)])
        at = np.array(np.meshgrid(*inside.T, indexing="ij")).reshape(3, -1).T
    wrench = np.array([force, 0, 0, 0, 0, 0]) if load is None else load
    plan = plan_of_poses(machine, "deflection", at, wrench[None])
    predictor = Predictor(machine, plan)
    parameters = fitted(machine.description, terms)
    columns = [
        c[:, :3] * p.scale for c, (_, p) in zip(slopes(predictor, terms, parameters), parameters, strict=True)
    ]
    stacked = np.stack(columns, axis=-1)
    return np.asarray(np.einsum("nak,nal->kl", stacked, stacked) / len(stacked))

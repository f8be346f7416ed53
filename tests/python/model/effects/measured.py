"""The measurement sets as plain arrays, read without the package's own reader."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import stiffmap as sm

DATA = Path(__file__).parents[3] / "data"


@dataclass(frozen=True)
class Set:
    """Positions (n, 3) m, wrenches (n, 6) N, readings (n, 3) m, noise m."""

    position: np.ndarray
    wrench: np.ndarray
    reading: np.ndarray
    noise: float
    loaded: bool


def read(name: str) -> Set:
    folder = DATA / "experiments" / name
    with open(folder / "data.csv", newline="") as file:
        rows = list(csv.DictReader(file))

    def columns(*names: str) -> np.ndarray:
        return np.array([[float(r[n]) for n in names] for r in rows])

    loaded = "fx" in rows[0]
    force = columns("fx", "fy", "fz") if loaded else np.zeros((len(rows), 3))
    text = (folder / "experiment.yaml").read_text()
    noise = float(text.split("dx: ")[1].split(",")[0]) * 1e-3
    wrench = np.hstack([force, np.zeros_like(force)])
    return Set(columns("x", "y", "z") * 1e-3, wrench, columns("dx", "dy", "dz") * 1e-3, noise, loaded)


@dataclass(frozen=True)
class Misfit:
    """Mean squares over the declared noise's variance: of all residuals, of the means over repeated
    readings (all that a model can change) and of the repeats about their means (none of it)."""

    all: float
    means: float
    repeats: float
    n_all: int
    n_means: int


def misfit(machine: sm.Machine, data: Set) -> Misfit:
    unique, back = np.unique(np.hstack([data.position, data.wrench]), axis=0, return_inverse=True)
    back = back.reshape(-1)
    predicted = machine.solve(unique[:, :3], unique[:, 3:]).displacement
    if data.loaded:
        places, of = np.unique(unique[:, :3], axis=0, return_inverse=True)
        predicted = predicted - machine.solve(places).displacement[of.reshape(-1)]
    residual = (data.reading - predicted[back, :3]) / data.noise
    count = np.bincount(back)
    means = np.array([residual[back == i].mean(axis=0) for i in range(len(unique))])
    of_means = float(np.sum(count[:, None] * means**2))
    of_repeats = float(np.sum((residual - means[back]) ** 2))
    n, k = residual.size, means.size
    return Misfit((of_means + of_repeats) / n, of_means / k, of_repeats / (n - k), n, k)


def usual(mean_square: float, n: int) -> bool:
    """Whether noise alone gives such a mean square in 95 of 100 sets."""
    low, high = chi2.interval(0.95, n)
    return bool(low / n <= mean_square <= high / n)

"""Laws that measured means are fitted with: the straight one, and those that explain why they bend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.process.description import EDGES, PRESSURES, EndMill, Process
from stiffmap.machining.process.gauss import gauss
from stiffmap.machining.process.identify.table import ForceTable
from stiffmap.machining.process.mean import engaged, mean_force, widened
from stiffmap.machining.process.revolution import mean_basis_with_runout

NAMES = ("Ktc", "Kte", "Krc", "Kre", "Kac", "Kae")
REFERENCE = 1e-3
"""m: chip at which a pressure with an exponent is stated."""
MOST_RUNOUT = 2.0
"""Of the largest feed per tooth."""


def unit_laws() -> list[EndMill]:
    """One coefficient each."""
    return [EndMill(**{**dict.fromkeys((*PRESSURES, *EDGES), 0.0), n: 1.0}) for n in NAMES]


def straight_basis(p: Process) -> Floats:
    """(3, 6) mean force per unit of each coefficient."""
    cuts = [replace(p, law=law) for law in unit_laws()]
    return np.stack([mean_force(c, c.cut.radial, c.cut.axial) for c in cuts], axis=1)


def power_basis(p: Process, exponents: Floats) -> Floats:
    """(3, 3) mean force per unit of three chip pressures K (h / REFERENCE)^-m, tangential, radial, axial (theory.md, M7)."""
    node, weight = gauss(100)
    first, last = (float(v) for v in engaged(p, widened(p, p.cut.radial)))
    phi = first + (last - first) * (node + 1) / 2
    s, c, w = np.sin(phi), np.cos(phi), weight * (last - first) / 2 * p.tool.teeth * p.cut.axial / (2 * np.pi)
    h = p.chip * s
    t, r, a = (w * h * (h / REFERENCE) ** -m for m in exponents)
    zero = 0.0
    return np.array(
        [[(-t * c).sum(), (-r * s).sum(), zero], [(t * s).sum(), (-r * c).sum(), zero], [zero, zero, a.sum()]]
    )


def runout_basis(p: Process, runout: Floats) -> Floats:
    """(3, 6) mean force per unit of each coefficient with run-out, which may lift teeth out of the cut."""
    tool = replace(p.tool, runout=float(runout[0]), runout_angle=0.0)
    return mean_basis_with_runout(replace(p, tool=tool))


def bent_basis(p: Process, _none: Floats) -> Floats:
    """(3, 9) with a term of the square of the feed for each axis: what bends, whatever its cause."""
    return np.hstack([straight_basis(p), np.eye(3) * (p.chip / 1e-4) ** 2])


@dataclass(frozen=True)
class Model:
    """A law: its basis at values of its own parameters, and what it says."""

    name: str
    words: str
    basis: Callable[[Process, Floats], Floats]
    parameters: tuple[str, ...] = ()
    coefficients: int = 6


MODELS = (
    Model("straight", "force grows in proportion to the chip", lambda p, _: straight_basis(p)),
    Model(
        "Kienzle",
        "the chip pressure falls as a power of the chip's thickness",
        power_basis,
        ("mt", "mr", "ma"),
        3,
    ),
    Model("run-out", "a tooth leaves the cut at the small feeds", runout_basis, ("offset",)),
    Model("bend", "a square of the feed in each axis, with no cause stated", bent_basis, (), 9),
)
LARGEST_EXPONENT = 0.98


@dataclass(frozen=True, eq=False)
class Fitted:
    """A law fitted to a table."""

    model: Model
    values: Floats
    """(k,) coefficients."""
    covariance: Floats
    """(k, k)."""
    parameter: Floats
    """(parameters,) of the model: exponents, or m of run-out."""
    residual: Floats
    """(n, 3) N, measured less fitted."""
    sigma: Floats
    """(3,) N, of the readings of each axis, from the residuals."""

    @property
    def misfit(self) -> float:
        """n log of the residual variances, summed over the axes: the smaller the likelier."""
        n = len(self.residual)
        return float(n * np.log(np.maximum((self.residual**2).mean(axis=0), 1e-18)).sum())

    def score(self) -> float:
        """Akaike's criterion with its correction for few readings; infinite where parameters equal readings."""
        n, k = self.residual.size, self.model.coefficients + len(self.model.parameters) + 3
        return np.inf if n - k - 1 <= 0 else self.misfit + 2 * k + 2 * k * (k + 1) / (n - k - 1)

    def predict(self, p: Process) -> Floats:
        """(3,) N, mean force of a cut."""
        return np.asarray(self.model.basis(p, self.parameter) @ self.values)


def fit(model: Model, table: ForceTable) -> Fitted:
    """Least squares with a variance of its own for each axis."""

    def at(values: Floats) -> Fitted:
        return _linear(model, table, values)

    if not model.parameters:
        return at(np.zeros(0))
    if model.name == "run-out":
        grid = np.linspace(0.0, MOST_RUNOUT * float(table.chip.max()), 13)
        best = int(np.argmin([at(np.array([v])).misfit for v in grid]))
        found = minimize_scalar(
            lambda v: at(np.array([v])).misfit,
            bounds=(grid[max(best - 1, 0)], grid[min(best + 1, 12)]),
            method="bounded",
            options={"xatol": 1e-3 * grid[1]},
        )
        return at(np.array([found.x]))
    start = np.full(len(model.parameters), 0.3)
    found = minimize(
        lambda v: at(np.clip(v, 0.0, LARGEST_EXPONENT)).misfit,
        start,
        method="Nelder-Mead",
        options={"xatol": 1e-4, "fatol": 1e-5, "maxfev": 400},
    )
    return at(np.clip(found.x, 0.0, LARGEST_EXPONENT))


def _linear(model: Model, table: ForceTable, parameter: Floats) -> Fitted:
    n = len(table.cuts)
    basis = np.stack([model.basis(p, parameter) for p in table.cuts])  # (n, 3, k)
    k = basis.shape[2]
    sigma = np.ones(3)
    freedom = max(n - (k + len(parameter)) / 3, 1e-9)
    for _ in range(3):  # the variances of the axes follow from the residuals
        a = (basis / sigma[:, None]).reshape(3 * n, k)
        size = np.linalg.norm(a, axis=0)
        size = np.where(size > 0, size, 1.0)
        values = np.linalg.lstsq(a / size, (table.force / sigma).ravel(), rcond=1e-12)[0] / size
        residual = table.force - basis @ values
        sigma = np.maximum(np.sqrt((residual**2).sum(axis=0) / freedom), 1e-9)
    a = (basis / sigma[:, None]).reshape(3 * n, k)
    covariance = np.linalg.pinv((a / size).T @ (a / size)) / np.outer(size, size)
    return Fitted(model, values, covariance, parameter, residual, sigma)

"""Uncertainty budget of a fitted number.

JCGM 100 (GUM): standard uncertainties of type A (statistics of the readings) and type B (certificates, judgement)
add in quadrature; Welch-Satterthwaite gives effective degrees of freedom; U = 2 u.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import instance_of, real_number, refused
from stiffmap.common.errors import StiffmapError
from stiffmap.common.units import DISPLAY_UNITS
from stiffmap.experiment.calls import as_experiment, effects_of
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.planning.estimate import Estimate, fitted, slopes
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine, takes_machine

PAIRS = "pairs of an effect and the standard uncertainties of its numbers"
K = 2.0
"""Coverage factor."""


@dataclass(frozen=True)
class BudgetLine:
    """One source of uncertainty of one number, SI."""

    source: str
    kind: str
    """``A``, ``B`` or ``model form``."""
    u: float
    freedom: float
    """Degrees of freedom; inf where u is taken as exact."""


@dataclass(frozen=True)
class NumberBudget:
    """Budget of one number."""

    name: str
    unit: str
    value: float
    lines: tuple[BudgetLine, ...]

    @property
    def u(self) -> float:
        """Combined standard uncertainty."""
        return float(np.sqrt(sum(line.u**2 for line in self.lines)))

    @property
    def freedom(self) -> float:
        """Effective degrees of freedom (Welch-Satterthwaite)."""
        bottom = sum(line.u**4 / line.freedom for line in self.lines if np.isfinite(line.freedom))
        return float(self.u**4 / bottom) if bottom > 0 else float("inf")

    @property
    def expanded(self) -> float:
        """U at k = 2."""
        return K * self.u

    def __str__(self) -> str:
        size, unit = DISPLAY_UNITS.get(self.unit, (1.0, self.unit))
        value, u, expanded = (size * v for v in (self.value, self.u, self.expanded))
        head = f"{self.name}: {value:.5g} {unit}, u = {u:.3g}, U (k = 2) = {expanded:.3g}"
        rows = [f"  {line.source} ({line.kind}): {size * line.u:.3g}" for line in self.lines]
        return "\n".join([f"{head}, {self.freedom:.0f} degrees of freedom", *rows])


@takes_machine
@checked
def budgets(
    machine: Machine,
    experiment: Experiment | str | PathLike[str],
    found: Estimate,
    others: Sequence[tuple[str | AppliedEffect, Mapping[str, float]]] = (),
) -> list[NumberBudget]:
    """A budget for every number of an estimate.

    found
        What `estimate` made of the experiment.
    others
        Effects that were not fitted, and the standard uncertainty (SI) of each of their numbers: dimensions of
        the machine, figures of an instrument's certificate. Each adds what it would have moved the fit by.

    Lines: noise of the readings (A), misfit beyond noise (model form: what the residuals show above
    it, spread over the readings), and one per number of `others` (B).

    Raises StiffmapError for a number that does not exist, and for an uncertainty below 0.
    """
    predictor = Predictor(machine, as_experiment(experiment))
    inverse = np.linalg.pinv(found.jacobian * found.scale) * found.scale[:, None]
    shifts = []
    for pair in instance_of(others, Sequence, "others", PAIRS):
        effect, given = instance_of(pair, tuple, "others", PAIRS)
        (term,) = effects_of(machine, effect, "others")
        parameters = [p for _, p in fitted(machine.description, (term,)) if p.name in given]
        unknown = set(given) - {p.name for p in parameters}
        if unknown:
            raise StiffmapError(f"budget: {term.kind} has no number '{sorted(unknown)[0]}' at this place")
        moved = slopes(predictor, (*found.terms, term), [(len(found.terms), p) for p in parameters])
        for p, move in zip(parameters, found.problem.white(moved).T, strict=True):
            if not (u := real_number(given[p.name], f"others: {p.name}")) >= 0.0:
                raise refused(f"others: {p.name}", "a standard uncertainty, 0 or more", f"{u:g}")
            shifts.append((f"{term.kind} of {term.element}: {p.name}", u, inverse @ move))
    form, freedom = float(np.sqrt(max(0.0, found.misfit**2 - 1.0))), float(max(found.freedom, 1))
    out = []
    for k, (name, unit, value) in enumerate(zip(found.names, found.units, found.values, strict=True)):
        sigma = float(found.sigma[k])
        lines = [BudgetLine("noise of the readings", "A", sigma, freedom)]
        if form > 0:
            lines.append(BudgetLine("misfit beyond noise", "model form", form * sigma, freedom))
        lines += [BudgetLine(source, "B", abs(u * float(s[k])), float("inf")) for source, u, s in shifts]
        out.append(NumberBudget(name, unit, float(value), tuple(lines)))
    return out

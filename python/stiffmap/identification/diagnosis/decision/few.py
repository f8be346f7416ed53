"""What any few effects on an exact machine could explain, before they are searched for.

The best few by linear screening, one after the other, and one full fit of them: how far that is from what the screen
promised says how far the screen can be trusted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.candidates.candidates import Candidate, clash
from stiffmap.identification.diagnosis.fitting.fit import fit
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.identification.diagnosis.search.screen import Screen
from stiffmap.identification.diagnosis.search.selection import MOST_EFFECTS, start_values
from stiffmap.identification.diagnosis.search.study import Study

MEETING = 10.0
"""Nats that each fault beyond the first costs."""
SURE = 30.0
"""Nats by which uncertain numbers must lead before single effects on an exact machine are not fitted at all, jointly with
what the screen was wrong by."""
HOPELESS = 25.0
"""Chi-square per reading that the best few, fitted, leave: no few effects on an exact machine do then."""


@dataclass(frozen=True, eq=False)
class Few:
    """The best few effects, taken as linear, one after the other."""

    screen: Screen
    which: tuple[int, ...]
    """Their numbers in the screen."""
    left: Floats
    """(N,) what all of them leave of the whitened residual."""
    chi2: tuple[float, ...]
    """What is left without any, with the first, with two …"""
    directions: tuple[int, ...]
    """How many they take, likewise."""

    def evidence(self, trials: float) -> float:
        """ln of the largest evidence of none to all of them, at the price of the search and of faults that meet."""
        each = float(np.log(max(trials, 1.0)))
        size = float(np.log(max(len(self.left), 2)))
        return max(
            -0.5 * (c + d * size) - k * each - MEETING * max(k - 1, 0)
            for k, (c, d) in enumerate(zip(self.chi2, self.directions, strict=True))
        )


def screened(s: Study) -> Few:
    """The best few effects of a study's screen on all its readings."""
    problem, screen = s.whole
    left, beside = problem.residual(s.plan.base), screen
    tangent = np.zeros((len(left), 0))
    which: list[int] = []
    chi2, directions = [float(left @ left)], [0]
    for _ in range(MOST_EFFECTS):
        reductions = beside.delta_chi2(left[:, None])[:, 0]
        taken = [screen.variants[i].candidate for i in which]
        downward = (int(i) for i in np.argsort(-reductions) if reductions[i] > 0.0)
        i = next((i for i in downward if _can_join(screen.variants[i].candidate, taken)), None)
        if i is None:
            break
        q = beside.basis(i)
        left = left - q @ (q.T @ left)
        tangent = np.column_stack([tangent, q])
        beside = screen.beside(tangent)
        which.append(i)
        chi2.append(float(left @ left))
        directions.append(int(tangent.shape[1]))
    return Few(screen, tuple(which), left, tuple(chi2), tuple(directions))


def _can_join(candidate: Candidate, taken: list[Candidate]) -> bool:
    return candidate not in taken and not clash(candidate, taken)


def fitted(s: Study, few: Few) -> float | None:
    """Chi-square of the best few through the full equilibrium; None where that fails."""
    problem, screen = s.whole
    if not few.which:
        return few.chi2[0]
    columns = [screen.columns(i) for i in few.which]
    residual = problem.residual(s.plan.base)
    estimate = np.asarray(np.linalg.lstsq(np.hstack(columns), residual, rcond=1e-5)[0], dtype=np.float64)
    model, at = Model(), 0
    for i, own in zip(few.which, columns, strict=True):
        part, at = estimate[at : at + own.shape[1]], at + own.shape[1]
        flat = ~np.any(own != 0.0, axis=0)
        starts = start_values(screen.variants[i], part, flat)
        held = np.flatnonzero(flat).tolist() if len(starts) == 1 else []
        model = model.plus(screen.variants[i].candidate, starts[0], held)
    found = fit(model, s.predictor, problem)
    return found.chi2 if found.usable else None


def not_few(s: Study, few: Few, spread: float) -> bool:
    """Whether no few effects on an exact machine are the whole story: a machine that is off everywhere leads by far
    (`spread`, ln of its evidence), or the best few leave far too much. Never without a fit that bears the screen out."""
    problem = s.whole[0]
    promised = few.evidence(s.effective_trials)
    most = HOPELESS * max(problem.freedom - few.directions[-1], 1)
    if spread <= promised + SURE and few.chi2[-1] <= most:
        return False
    full = fitted(s, few)
    if full is None:
        return False
    wrong = 0.5 * abs(full - few.chi2[-1])
    return spread > promised + SURE + wrong or min(full, few.chi2[-1]) > most

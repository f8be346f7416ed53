"""The hypotheses that the readings support, and the fit with their priors widened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, norm

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.folds import folds
from stiffmap.identification.calibration.calibrator import Calibrator, pose_labels
from stiffmap.identification.calibration.claims import BesideField, Claims, claims, held_within
from stiffmap.identification.calibration.floor import model_form
from stiffmap.identification.calibration.groups import STRONG
from stiffmap.identification.calibration.held_out import Fold, leave_out, left_out
from stiffmap.identification.calibration.model import Fitted, predicted
from stiffmap.identification.calibration.statistics import Sums, gain_of
from stiffmap.identification.calibration.wording import odds

AGAIN, NEAR = 4, 0.3
"""Fits of what is claimed through the full prediction; change of all readings together, in noise, that ends them."""
MOST_DRAWS = 5.0 / 6.0
"""Share of other draws that must show what is claimed of a whole group: vague claims come and go otherwise."""
BORNE_OUT = 0.5
"""Share of what slopes promise of a claim that the full prediction must keep."""


def claimed_fit(
    ready: Calibrator, sums: Sums, members: dict[str, list[int]], seed: int
) -> tuple[Claims, Fitted, float]:
    """Accepted hypotheses, the fit with their priors widened, and its variance per pose."""
    shares: dict[tuple[int, ...], float] = {}
    judged: list[tuple[BesideField, list[Fold]]] = []
    everything = {"all": list(range(len(sums.right)))}

    def why_not(factor: Floats, trial: Floats, which: Sequence[int]) -> str:
        if not judged:
            judged.append((_beside_field(ready), leave_out(ready, ready.fit, seed)))
        field, parts = judged[0]
        nats = field.log_evidence(trial) - field.log_evidence(factor)
        shares[tuple(which)] = found_again(nats)
        if nats < STRONG:
            return f"a smooth field that does not depend on the machine explains as much (odds {odds(nats)} with the field in the model)"
        if len(which) > 1 and found_again(nats) < MOST_DRAWS:
            return (
                f"odds {odds(nats)} jointly with a smooth field: another draw of as many readings would show it with "
                f"{100 * found_again(nats):.0f} % only"
            )
        if len(parts) < 2:
            return ""
        tolerated = _tolerated(sums, factor, which)
        one, other = (
            left_out(ready, parts, everything, ready.fit, ready.rho, f)["all"] for f in (tolerated, trial)
        )
        gain, error = gain_of(one, other, [f.test for f in parts])
        # a fit that is as good as noise has nothing to gain
        holds = gain > (error if misfits else -error)
        return "" if holds else f"held-out readings gain {gain:.2g} ± {error:.2g} noise variances"

    misfits = ready.misfits(ready.fit, np.ones(len(sums.right)))
    found = claims(
        sums, ready.sensitivity.unknowns, members, _folds(ready, seed), ready.sensitivity.at, why_not
    )
    if not found.any:
        return found, ready.fit, ready.rho
    names: dict[str, tuple[int, ...]] = {
        b.name: (i,) for b, i in zip(found.singles.found, found.singles.which, strict=True)
    }
    names |= {f"{w.group} as a whole": tuple(members[w.group]) for w in found.groups}
    found = replace(found, found_again={n: shares[i] for n, i in names.items() if i in shares})
    fit, rho = _let_go(ready, found)
    if fit.converged:
        return found, fit, rho
    return found.withdrawn("so far off the machine does not do what its slopes say"), ready.fit, ready.rho


def found_again(nats: float) -> float:
    """Share of other draws of as many readings in which a claim would be strong: a gain of so many nats, from readings with
    normal noise, varies by √(2 nats) from draw to draw."""
    return float(norm.cdf((nats - STRONG) / np.sqrt(2.0 * nats))) if nats > 0.0 else 0.0


def _tolerated(sums: Sums, factor: Floats, which: Sequence[int]) -> Floats:
    """Factors (p,) under which the unknowns `which` stay where tolerances allow them to be, 95 % of the time."""
    return held_within(sums, factor, which, float(np.sqrt(chi2.isf(0.05, len(which)) / len(which))))


def _folds(ready: Calibrator, seed: int) -> list[Sums]:
    """The sums of each fold's own readings."""
    label = folds(ready.predictor.experiment, seed)[0][ready.problem.index[0]]
    return [ready.blocks(label == k).beside(ready.rho) for k in np.unique(label)]


def _beside_field(ready: Calibrator) -> BesideField:
    left = ready.left(ready.fit.prediction)
    return BesideField.of(ready.problem, ready.columns, ready.fit.linear, pose_labels(ready.problem), left)


def _let_go(ready: Calibrator, claimed: Claims) -> tuple[Fitted, float]:
    """The fit with the priors of the accepted hypotheses widened, and its floor: by the slopes that there are, through the full prediction."""
    names, at = ready.sensitivity.unknowns, ready.sensitivity.at
    fit, rho, promised = ready.fit, ready.rho, 0.0
    let_go = np.flatnonzero(claimed.factor > 1.0).tolist()
    tolerated = _tolerated(ready.sums, np.ones(len(names)), let_go)
    held = fit.linear - ready.columns @ (ready.sums.scaled(tolerated).estimate * tolerated)
    before = float(held @ held)
    for again in range(AGAIN):
        blocks = ready.blocks(fit=fit).scaled(claimed.factor)
        rho = model_form(blocks)
        values = blocks.beside(rho).estimate * claimed.factor
        told = fit.linear - ready.columns @ values
        promised = promised if again else before - float(told @ told)
        close = float(np.linalg.norm(ready.columns @ (values - fit.values))) < NEAR
        try:
            prediction = predicted(ready.predictor, names, claimed.singles.built(values, names, at))
            residual = ready.problem.residual(prediction)
        except StiffmapError:
            return replace(fit, converged=False), rho
        fit = Fitted(values, prediction, residual, residual + ready.columns @ values, True)
        if close:
            break
    gained = before - float(fit.residual @ fit.residual)
    return replace(fit, converged=gained > BORNE_OUT * promised), rho

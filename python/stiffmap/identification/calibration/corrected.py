"""The corrected machine: calibrated numbers, effects and axis positioning errors together, as one machine file has them.

What is said of a result must be said of this machine and nothing else: the same fit makes it from all readings, for the
user, and from the readings outside a fold, to see what it says of those in the fold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Floats, Integers, Mask
from stiffmap.experiment.noise.folds import folds
from stiffmap.experiment.noise.unseen import left_unseen
from stiffmap.experiment.noise.whitening import Problem
from stiffmap.identification.calibration.calibrator import Calibrator, pose_labels
from stiffmap.identification.calibration.certificate import INSTRUMENT
from stiffmap.identification.calibration.claims import Claims
from stiffmap.identification.calibration.floor import Blocks, model_form
from stiffmap.identification.calibration.model import predicted
from stiffmap.identification.calibration.slopes import moves_of
from stiffmap.identification.calibration.travel import Hats
from stiffmap.identification.calibration.unknowns import joint_name
from stiffmap.model.description import AppliedEffect, Joint
from stiffmap.model.description.tree import joints
from stiffmap.model.with_errors import Knots, edited
from stiffmap.solve.machine import Machine

STEPS, HALVINGS, NEAR = 6, 4, 0.1
"""Gauss-Newton steps at most, halvings of one, and change of all readings together, in noise, that ends them."""

TURNS = 2
"""At which the errors of a turning drive are repeated, at most, to either side."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """A corrected machine and what it says of the readings."""

    machine: Machine
    values: Floats
    """(p,) of the unknowns, in standard uncertainties."""
    prediction: Floats
    """(n, c)."""


@dataclass(frozen=True, eq=False)
class Correction:
    """How readings make a corrected machine; `of` does it for some of them."""

    ready: Calibrator
    claims: Claims
    rho: float
    """Model-form floor."""
    start: Floats
    """(p,) values that the fits begin with."""
    hats: Hats | None = None
    """Axis positioning errors of the drives, where they hold on readings that were not seen."""

    def of(self, keep: Mask, terms: Sequence[AppliedEffect] = ()) -> Corrected:
        """The machine by the rows in `keep` (n,), with effects `terms` in it."""
        ready, factor = self.ready, self.claims.factor
        names, p = ready.sensitivity.unknowns, ready.predictor
        problem = Problem.of(p.experiment, ready.noise.sigma, ready.problem.base, keep & ~ready.out)
        columns, label = problem.white(ready.sensitivity.columns), pose_labels(problem)
        values, prediction, rho = self.start, self._predicted(self.start, terms), self.rho
        for _ in range(STEPS):
            linear = problem.residual(prediction) + columns @ values
            blocks = Blocks.of(columns, linear, label, problem.nuisance.shape[1]).scaled(factor)
            rho = model_form(blocks) if terms else rho  # what the effects explain is no floor
            better = blocks.beside(rho).estimate * factor
            if float(np.linalg.norm(columns @ (better - values))) < NEAR:
                break
            moved = self._moved(problem, values, better - values, prediction, terms, rho)
            if moved is None:
                break
            values, prediction = moved
        built = self._built(values)
        moves = moves_of([(u, float(v)) for u, v in zip(names, built, strict=True) if not u.setup])
        own = {(at, what): by for (at, what), by in moves.items() if at != INSTRUMENT}
        knots = {}
        if self.hats is not None:
            linear = problem.residual(prediction) + columns @ values
            declared = p.machine.description
            found = self.hats.knots(problem, columns * factor, linear, rho)
            knots = {name: at_every_turn(joints(declared)[joint_name(name)], k) for name, k in found.items()}
            beside = p.beside(machine=Machine(edited(declared, {}, knots), like=p.machine))
            prediction = predicted(beside, names, built, terms)
        machine = Machine(edited(p.with_terms(terms).description, own, knots), like=p.machine)
        return Corrected(machine, values, prediction)

    def _moved(
        self,
        problem: Problem,
        values: Floats,
        step: Floats,
        prediction: Floats,
        terms: Sequence[AppliedEffect],
        rho: float,
    ) -> tuple[Floats, Floats] | None:
        """Values and prediction a step further, halved while misfit and prior grow or the machine is not there; None: no
        step is better."""

        def cost(at: Floats, shown: Floats) -> float:
            left = problem.residual(shown)
            return float(left @ left) / (1.0 + rho) + float(np.sum((at / self.claims.factor) ** 2))

        before = cost(values, prediction)
        for _ in range(HALVINGS):
            try:
                shown = self._predicted(values + step, terms)
                if cost(values + step, shown) <= before:
                    return values + step, shown
            except StiffmapError:
                pass
            step = step / 2.0
        return None

    def _built(self, values: Floats) -> Floats:
        s = self.ready.sensitivity
        return self.claims.singles.built(values, s.unknowns, s.at)

    def _predicted(self, values: Floats, terms: Sequence[AppliedEffect]) -> Floats:
        s = self.ready.sensitivity
        return predicted(self.ready.predictor, s.unknowns, self._built(values), terms)

    def unseen(self, seed: int) -> tuple[Floats, Floats, Integers, str] | None:
        """(n, c) residuals of the declared and of the corrected machine where each fold is predicted by the others, the
        fold (n,) of each row and what a fold is; None where there are not two folds."""
        e = self.ready.predictor.experiment
        label, by = folds(e, seed)
        if not label.max():
            return None
        before, after = np.full_like(e.reading, np.nan), np.full_like(e.reading, np.nan)
        for k in range(int(label.max()) + 1):
            test = label == k
            for out, prediction in (
                (before, self.ready.sensitivity.base),
                (after, self.of(~test).prediction),
            ):
                out[test] = self.left(prediction, test)[test]
        gone = self.ready.out
        before[gone] = after[gone] = np.nan
        return before, after, label, by

    def left(self, prediction: Floats, test: Mask) -> Floats:
        """(n, c) reading minus prediction of rows in `test` (n,), less unknown frames, tools and zeros as the other rows
        determine them."""
        e, out = self.ready.predictor.experiment, self.ready.out
        return left_unseen(e, self.ready.noise.sigma, prediction, ~test & ~out, test & ~out)


def at_every_turn(joint: Joint, knots: Knots) -> Knots:
    """The errors of a drive that turns, repeated at each turn of its range that they do not reach: gears and encoders
    return to where they were."""
    ends = joint.drive.range if joint.drive and joint.drive.range else None
    turn = 2.0 * math.pi
    if joint.kind != "revolute" or ends is None or knots[-1][0] - knots[0][0] >= turn:
        return knots
    out = list(knots)
    for _ in range(TURNS):
        if out[0][0] <= ends[0]:
            break
        out = [(u - turn, e) for u, e in out[: len(knots)]] + out
    for _ in range(TURNS):
        if out[-1][0] >= ends[1]:
            break
        out = out + [(u + turn, e) for u, e in out[-len(knots) :]]
    return tuple(out)

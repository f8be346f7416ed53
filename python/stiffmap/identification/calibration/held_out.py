"""Readings left out in folds, and predicted from the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats, Mask
from stiffmap.experiment.noise.folds import folds
from stiffmap.identification.calibration.calibrator import Calibrator
from stiffmap.identification.calibration.facts import HeldOut
from stiffmap.identification.calibration.floor import Blocks
from stiffmap.identification.calibration.groups import BASE, Choice
from stiffmap.identification.calibration.homing import own_part
from stiffmap.identification.calibration.model import Fitted

Size = Callable[[Floats], float]
"""rms of (n, c) residuals in the unit of the report."""


@dataclass(frozen=True, eq=False)
class Fold:
    """Readings that are left out together, and the others."""

    test: Mask
    """(N,)."""
    others: Blocks


def leave_out(ready: Calibrator, fit: Fitted, seed: int) -> list[Fold]:
    """Which readings (N,) each fold leaves out, and the others in blocks; nothing where there are not two folds."""
    label = folds(ready.predictor.experiment, seed)[0]
    at = label[ready.problem.index[0]]
    tests = [at == k for k in range(int(label.max()) + 1)] if label.max() else []
    return [Fold(test, ready.blocks(~test, fit)) for test in tests]


def left_out(
    ready: Calibrator,
    parts: Sequence[Fold],
    sets: Mapping[str, Sequence[int]],
    fit: Fitted,
    rho: float,
    factor: Floats,
) -> dict[str, Floats]:
    """(N,) residual of each fold predicted from the others, by sets of unknowns at `factor` times their uncertainty."""
    left = {name: np.zeros(len(ready.problem)) for name in sets}
    for fold in parts:
        others = fold.others.beside(rho).scaled(factor)
        for name, which in sets.items():
            values = np.zeros(len(factor))
            values[list(which)] = others.pick(which).estimate * factor[list(which)]
            rest = fit.linear - ready.columns @ values
            own = own_part(ready.sensitivity.unknowns, ready.columns, rest, fold.test)
            left[name][fold.test] = (rest - own)[fold.test]
    return left


def held_out(
    ready: Calibrator, choice: Choice, factor: Floats, fit: Fitted, rho: float, seed: int, size: Size
) -> HeldOut | None:
    """Each fold predicted from the others, linear in the unknowns; frames from all readings."""
    _, by = folds(ready.predictor.experiment, seed)
    parts = leave_out(ready, fit, seed)
    if not parts:
        return None
    members = ready.members()
    base = [i for g in BASE for i in members.get(g, [])]
    sets: dict[str, list[int]] = {
        "all": list(range(len(factor))),
        "chosen": sorted({*base, *(i for g in choice.chosen for i in members[g])}),
    } | {g: sorted({*base, *i}) for g, i in members.items() if g not in BASE}
    left = left_out(ready, parts, sets, fit, rho, factor)
    found = {name: size(ready.unwhite(r)) for name, r in left.items()}
    keep = ~ready.out[:, None]
    before = size(np.where(keep, ready.left(ready.sensitivity.base), np.nan))
    return HeldOut(by, before, found.pop("all"), found.pop("chosen"), found)

"""How every pose of a map is solved."""

from __future__ import annotations

from dataclasses import replace
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.machine import Machine
from stiffmap.solve.options import LoadingKeywords, options_of
from stiffmap.solve.solution import Solution
from stiffmap.solve.solving import Call
from stiffmap.solve.status import Status
from stiffmap.solve.variants import solve_varied


class Loading:
    """A machine and the options that a whole map shares."""

    def __init__(self, machine: Machine, **given: Unpack[LoadingKeywords]) -> None:
        self.machine = machine
        self.options = options_of(given)

    def solve(self, position: Floats, wrench: Floats, *, stiffness: bool = True) -> Solution:
        """Equilibria at positions (..., 3) under wrenches (..., 6), broadcast together; without the 6x6 if not asked."""
        return self.machine.solve(position, wrench, **replace(self.options, stiffness=stiffness).keywords())

    def solve_varied(
        self, position: Floats, wrench: Floats, variants: tuple[Machine, ...]
    ) -> tuple[Solution, Floats]:
        """Also the displacements (..., variants, 6) of machines near this one, exact to first order."""
        call = Call(position, wrench, replace(self.options, stiffness=False))
        return solve_varied(self.machine.compiled, call, [m.compiled for m in variants])

    def acting_gravity(self) -> list[float]:
        """Gravity that acts (m/s², base axes)."""
        return [float(g) for g in self.machine.compiled.gravity(self.options.gravity)]


def without_failed(values: Floats, status: NDArray[np.uint8], keep_unstable: bool = False) -> Floats:
    """Values (..., *tail) with NaN where the pose of `status` (...) failed."""
    kept = status == Status.CONVERGED
    kept |= status == Status.SINGULAR  # what is undetermined there is NaN already
    if keep_unstable:
        kept |= status == Status.UNSTABLE
    tail = (1,) * (values.ndim - status.ndim)
    return np.where(kept.reshape(status.shape + tail), values, np.nan)

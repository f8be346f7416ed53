"""How every pose of a map is solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.broadcasting import Floats
from stiffmap.machine import Machine
from stiffmap.solution import Solution
from stiffmap.solving import Call
from stiffmap.status import Status
from stiffmap.variants import solve_varied


@dataclass(frozen=True)
class Loading:
    """A machine and the options of `Machine.solve` that a whole map shares."""

    machine: Machine
    point: str = "tcp"
    rotation: Any = None
    gravity: Any = None
    load_type: str = "dead"
    method: str = "fast"
    load_steps: int | str = "auto"
    threads: int | None = None

    def solve(self, position: Floats, wrench: Floats) -> Solution:
        """Equilibria at positions (..., 3) under wrenches (..., 6), broadcast together."""
        return self.machine.solve(
            position,
            wrench,
            rotation=self.rotation,
            point=self.point,
            gravity=self.gravity,
            load_type=self.load_type,
            method=self.method,
            load_steps=self.load_steps,
            threads=self.threads,
        )

    def solve_varied(
        self, position: Floats, wrench: Floats, variants: tuple[Machine, ...]
    ) -> tuple[Solution, Floats]:
        """Also the displacements (..., variants, 6) of machines near this one, exact to first order."""
        call = Call(
            position,
            wrench,
            self.rotation,
            self.point,
            load_type=self.load_type,
            gravity=self.gravity,
            method=self.method,
            load_steps=self.load_steps,
            stiffness=False,
            threads=self.threads,
        )
        return solve_varied(self.machine, call, variants)

    def options(self) -> dict[str, Any]:
        """What changes the numbers, as plain data; threads do not."""
        plain = {k: getattr(self, k) for k in ("point", "load_type", "method", "load_steps")}
        for name in ("rotation", "gravity"):
            value = getattr(self, name)
            plain[name] = None if value is None else np.asarray(value, dtype=float).tolist()
        return plain

    def acting_gravity(self) -> list[float]:
        """Gravity that acts (m/s², base axes)."""
        given = self.machine.description.gravity if self.gravity is None else self.gravity
        return [0.0, 0.0, 0.0] if given is None else [float(g) for g in given]


def without_failed(values: Floats, status: NDArray[np.uint8], keep_unstable: bool = False) -> Floats:
    """Values (..., *tail) with NaN where the pose of `status` (...) failed."""
    kept = status == Status.CONVERGED
    kept |= status == Status.SINGULAR  # what is undetermined there is NaN already
    if keep_unstable:
        kept |= status == Status.UNSTABLE
    tail = (1,) * (values.ndim - status.ndim)
    return np.where(kept.reshape(status.shape + tail), values, np.nan)

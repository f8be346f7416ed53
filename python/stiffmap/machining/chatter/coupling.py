"""Mode coupling without regeneration: eigenvalues of M and K - Kp f n' (docs/theory.md V6; Gasparetto; Pan, Zhang et al.)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.chatter.cut import GivenProcess, mean_chips, milling_process
from stiffmap.machining.chatter.modes import ToolModes, mode_rows

DEEPEST = 1.0
"""m: a limit beyond it is none."""


@dataclass(frozen=True, eq=False)
class ModeCoupling:
    """Eigenvalues of the cut at one depth."""

    square: np.ndarray
    """(modes,) of M and K - Kp f n', (rad/s)²: complex or negative ones are unstable without damping."""
    growth: float
    """1/s, largest real part with damping: above zero unstable."""

    @property
    def unstable(self) -> bool:
        """Without damping: a pair that is complex, or a square that is negative."""
        size = np.abs(self.square).max()
        return bool((np.abs(self.square.imag) > 1e-9 * size).any() or (self.square.real < 0).any())


def mode_coupling(modes: ToolModes | Iterable[Any], process: GivenProcess, depth: float) -> ModeCoupling:
    """At a depth of cut (m); modes in the axes of the cut. Raises StiffmapError for bad input."""
    m = mode_rows(modes)
    return _coupled(m, mean_chips(milling_process(process)), depth)


def coupling_depth(modes: ToolModes | Iterable[Any], process: GivenProcess) -> float:
    """m: least depth at which modes couple with damping, to 1e-6 of it; infinite where there is none up to 1 m."""
    m, chip = mode_rows(modes), mean_chips(milling_process(process))
    depths = np.geomspace(1e-6, DEEPEST, 400)
    bad = next((i for i, a in enumerate(depths) if _coupled(m, chip, a).growth > 0), None)
    if bad is None:
        return float("inf")
    low, high = (0.0 if bad == 0 else depths[bad - 1]), depths[bad]
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if _coupled(m, chip, middle).growth > 0 else (middle, high)
    return float(high)


def _coupled(m: ToolModes, chip: Floats, depth: float) -> ModeCoupling:
    seen = m.way[:, :2]
    square = np.diag((2 * np.pi * m.frequency) ** 2) - depth * (m.way @ chip @ seen.T) / m.mass[:, None]
    n = len(m)
    first = np.zeros((2 * n, 2 * n))
    first[:n, n:] = np.eye(n)
    first[n:, :n] = -square
    first[n:, n:] = -np.diag(4 * np.pi * m.ratio * m.frequency)
    return ModeCoupling(np.linalg.eigvals(square).astype(complex), float(np.linalg.eigvals(first).real.max()))

"""Quantities that need the modes of the machine at each pose."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.machine import Machine
from stiffmap.ui.view.place import orientation
from stiffmap.ui.view.state import State
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies, natural_frequencies
from stiffmap.workspace.vibration import frequency_response

MODES = 40
"""As parallel machines have dozens of modes of their bars below those that move the tool."""
DAMPING = 0.02
"""Modal damping ratio of every mode."""


def modes_at(
    machine: Machine, state: State, position: Floats, modes: int, threads: int | None = None
) -> NaturalFrequencies:
    """The lowest modes at (..., 3) m under the load of a state; StiffmapError where bodies lack masses."""
    return natural_frequencies(
        machine, position, state.wrench, rotation=orientation(state), gravity=state.gravity, modes=modes,
        threads=threads,
    )  # fmt: skip


def lowest_frequency(machine: Machine, state: State, position: Floats) -> tuple[Floats, Floats]:
    """(...) Hz and statuses."""
    w = modes_at(machine, state, position, 1)
    return np.asarray(w.frequency[..., 0]), np.asarray(w.status, dtype=float)


def dynamic_stiffness(machine: Machine, state: State, position: Floats) -> tuple[Floats, Floats]:
    """(...) N/m of the softest direction at the state's frequency, and statuses; modes beyond the lowest count as statics."""
    found = frequency_response(
        machine, position, [state.frequency], state.wrench, rotation=orientation(state), gravity=state.gravity,
        damping=DAMPING, modes=MODES, symmetrise=True,
    )  # fmt: skip
    c = found.values[..., 0, :3, :3]
    good = np.isfinite(c).all(axis=(-2, -1))
    softest = np.linalg.norm(np.where(good[..., None, None], c, np.eye(3)), 2, axis=(-2, -1))
    return np.where(good, 1.0 / softest, np.nan), np.asarray(found.status, dtype=float)

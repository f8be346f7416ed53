"""Quantities that need the modes of the machine at each pose."""

from __future__ import annotations

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.solve.machine import Machine
from stiffmap.ui.view.place import orientation
from stiffmap.ui.view.state import State
from stiffmap.workspace.performance.motion.inertia import NaturalFrequencies, natural_frequencies

MODES = 40
"""As parallel machines have dozens of modes of their bars below those that move the tool."""
DAMPING = 0.02
"""Modal damping ratio of every mode."""
STEP = 1e-7
"""m or rad, of the coordinate that moves most, in the difference that gives the tool's motion in a mode."""


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
    """(...) N/m of the softest direction at the state's frequency, and statuses.

    Compliance of the tool = the static one, in which all modes are, plus what the lowest modes add at the frequency:
    C + sum phi phiᵀ (1/(w² - W² + 2 i z w W) - 1/w²), with the damping ratio z = 0.02 of every mode.
    """
    w = modes_at(machine, state, position, MODES)
    static = machine.solve(position, state.wrench, rotation=orientation(state), gravity=state.gravity)
    shape = w.frequency.shape[:-1]
    c = static.compliance[..., :3, :3].reshape(-1, 3, 3)
    out = np.full(len(c), np.nan)
    frequency = w.frequency.reshape(len(c), -1)
    shapes, at = w.shape.reshape(len(c), frequency.shape[1], -1), w.coordinates.reshape(len(c), -1)
    for i in range(len(c)):
        if np.isfinite(c[i]).all() and np.isfinite(frequency[i]).any():
            out[i] = 1.0 / _compliance(machine, c[i], frequency[i], shapes[i], at[i], state.frequency)
    return out.reshape(shape), np.asarray(w.status, dtype=float)


def _compliance(
    machine: Machine, static: Floats, frequency: Floats, shapes: Floats, at: Floats, excited: float
) -> float:
    """m/N, greatest over directions of the complex compliance of the tool's translations."""
    omega, big = 2 * np.pi * frequency, 2 * np.pi * excited
    total = static.astype(complex)
    rest = machine.compiled.frames(at)[0][-1]
    for w, shape in zip(omega, shapes, strict=True):
        if not np.isfinite(w) or w <= 0:
            continue
        step = STEP / max(float(np.abs(shape).max()), 1e-300)
        phi = (machine.compiled.frames(at + step * shape)[0][-1] - rest) / step
        total = total + np.outer(phi, phi) * (1 / (w**2 - big**2 + 2j * DAMPING * w * big) - 1 / w**2)
    return float(np.linalg.svd(total, compute_uv=False)[0])

"""Natural frequencies of the elastic machine, its drives held (docs/theory.md D7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import (
    Floats,
    thread_count,
    whole_number,
)
from stiffmap.common.short import short_repr
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.results import OverPoses
from stiffmap.workspace.performance.motion.inertia import inertias, need_masses
from stiffmap.workspace.performance.poses import loaded_poses


@short_repr
@dataclass(frozen=True, eq=False)
class NaturalFrequencies(OverPoses):
    """Undamped modes at poses (...), lowest first; NaN beyond the last one and where the pose failed."""

    frequency: Floats
    """(..., modes) Hz."""
    shape: Floats
    """(..., modes, coordinates) m, rad: change of all coordinates, of unit modal mass (1 kg·m²)."""
    coordinates: Floats
    """(..., coordinates) at the equilibrium about which the machine vibrates."""
    status: NDArray[np.uint8]
    flags: NDArray[np.uint32]

    def __array__(self, dtype: object = None, copy: bool | None = None) -> Floats:
        return np.asarray(self.frequency, dtype=dtype)  # type: ignore[call-overload, no-any-return]


@takes_machine
def natural_frequencies(
    machine: Machine,
    position: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    modes: int = 6,
    threads: int | None = None,
) -> NaturalFrequencies:
    """Frequencies (Hz) and mode shapes at commanded poses (..., 3) m, drives held.

    Mass matrix over all elastic coordinates, passive joints following, against the exact tangent at
    the loaded equilibrium: `wrench` (..., 6) N, N·m dead at the TCP and `gravity` (3,) m/s² (None: what
    the machine file says) change the stiffness. Bodies are rigid, as the machine file declares
    them. A dead moment makes the tangent unsymmetric: complex frequencies are flutter, status UNSTABLE.
    Raises StiffmapError for bad input (a machine without masses), never for a pose.
    """
    need_masses(machine, "a natural frequency")
    whole_number(modes, "modes", 1)
    shape, p, r, w = loaded_poses(machine, position, wrench, rotation)
    out = machine.compiled.modes(
        inertias(machine), p, r, w, count=modes, whole=True, gravity=machine.compiled.gravity(gravity),
        threads=thread_count(threads),
    )  # fmt: skip
    w0 = 1 / np.sqrt(out["square"])
    found = {k: out[k].reshape(shape + out[k].shape[1:]) for k in ("coordinates", "status", "flags")}
    return NaturalFrequencies(
        frequency=(w0 / (2 * np.pi)).reshape(*shape, -1),
        shape=(w0[..., None] * out["shape"]).reshape(*shape, *out["shape"].shape[1:]),
        **found,
    )

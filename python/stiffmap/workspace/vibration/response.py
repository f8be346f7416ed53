"""Frequency response of a machine at its tool (docs/vibration.md)."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.vibration.modes import SYMMETRIC, TipModes, tip_modes
from stiffmap.workspace.vibration.poles import Complex, receptance

KINDS = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Displacement, velocity, acceleration by force: derivatives of a receptance by time."""
MOTION = ("x", "y", "z", "rx", "ry", "rz")
FORCE = ("fx", "fy", "fz", "mx", "my", "mz")


@takes_machine
def frequency_response(
    machine: Machine,
    position: ArrayLike,
    frequencies: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    rotation: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    point: str = "tcp",
    damping: ArrayLike | None = None,
    modes: int | None = None,
    kind: str = "receptance",
    symmetrise: bool = False,
    threads: int | None = None,
) -> xr.DataArray:
    """Response of the machine to a force that oscillates at a point, its drives held.

    Parameters
    ----------
    position
        (..., 3) m, commanded TCP, base axes.
    frequencies
        (frequency,) Hz, rising, from 0 on.
    wrench
        (..., 6) N, N·m, dead at `point`: the load about whose equilibrium the machine vibrates.
    rotation
        (..., 3, 3), commanded orientation; None: as at home.
    gravity
        (3,) m/s²; None: what the machine file says.
    point
        Where force and motion are: a named point.
    damping
        One damping ratio or a list, for the modes in the order of their frequencies; None: what the machine file declares, and
        2 % of every mode where it declares nothing.
    modes
        How many are kept; the others count by their static flexibility. None: all.
    kind
        ``receptance`` (m/N), ``mobility`` (m/s/N) or ``accelerance`` (m/s²/N).
    symmetrise
        A dead moment makes the stiffness unsymmetric. True: its symmetric part is taken; False: that is an error.
    threads
        None: all cores that this process may use.

    Returns
    -------
    DataArray
        Complex, dimensions (..., frequency, response, force), SI, base axes. Coordinates `status` of each pose;
        attributes: `damping` in words (also what was assumed), `unsymmetric` where a part of the stiffness was left out.
        NaN where the pose failed. At 0 Hz the receptance is the loaded compliance.

    Raises StiffmapError for bad input (a machine without masses, frequencies that do not rise), never for a pose.
    Source: docs/theory.md, V1 to V3.
    """
    f = frequency_axis(frequencies)
    if kind not in KINDS:
        raise StiffmapError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
    found = tip_modes(
        machine, position, wrench, rotation=rotation, gravity=gravity, point=point, damping=damping, modes=modes,
        symmetrise=symmetrise, threads=threads,
    )  # fmt: skip
    values = receptance(found, f, threads)
    if KINDS[kind]:
        values *= ((2j * np.pi * f) ** KINDS[kind])[:, None, None]
    return response_array(values, f, found, machine.name, point, kind)


def frequency_axis(frequencies: ArrayLike) -> Floats:
    """(frequencies,) Hz; StiffmapError unless finite, rising and not negative."""
    f = np.atleast_1d(real_array(frequencies, "frequencies", "frequencies (Hz)"))
    if f.ndim != 1 or not f.size:
        raise StiffmapError(f"frequencies: expected a list of frequencies (Hz), got shape {f.shape}")
    if not np.isfinite(f).all() or f[0] < 0:
        raise StiffmapError("frequencies: expected finite frequencies (Hz) from 0 on")
    fall = np.flatnonzero(np.diff(f) <= 0)
    if fall.size:
        k = int(fall[0])
        raise StiffmapError(
            f"frequencies: expected rising frequencies (Hz); entry {k + 2} is {f[k + 1]:g} after {f[k]:g}"
        )
    return f


def response_array(
    values: Complex, frequency: Floats, modes: TipModes, machine: str, point: str, kind: str
) -> xr.DataArray:
    """Values (n, frequencies, 6, 6) with their axes."""
    batch = modes.shape
    poses = ("pose",) if len(batch) == 1 else tuple(f"pose_{i}" for i in range(len(batch)))
    attrs: dict[str, object] = {
        "machine": machine, "point": point, "kind": kind, "axes": "base axes, linear part first, SI",
        "damping": modes.damping.said,
        "modal": "real modes" if modes.proportional else "complex modes: the damping couples them",
    }  # fmt: skip
    worst = float(np.nanmax(modes.unsymmetric, initial=0.0))
    if worst > SYMMETRIC:
        attrs["unsymmetric"] = worst
        attrs["symmetrised"] = "the symmetric part of the loaded stiffness was taken"
    return xr.DataArray(
        values.reshape(*batch, *values.shape[1:]),
        dims=(*poses, "frequency", "response", "force"),
        coords={
            "frequency": ("frequency", frequency, {"units": "Hz"}),
            "response": list(MOTION),
            "force": list(FORCE),
            "status": (poses, modes.status.reshape(batch)),
        },
        name=kind,
        attrs=attrs,
    )

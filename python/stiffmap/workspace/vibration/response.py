"""Frequency response of a machine at its tool (docs/vibration.md): real modes in closed form, others by their poles (docs/theory.md V3)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.broadcasting import Floats, one_of, thread_count
from stiffmap.model.description import TASK
from stiffmap.model.files.load import Source
from stiffmap.solve.labels import WRENCH, batch_dims
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.solve.options import keywords_of
from stiffmap.workspace.maps.inputs import rising
from stiffmap.workspace.vibration.modes import SYMMETRIC, TipModes, tip_modes

Complex = NDArray[np.complex128]
WORST_BASIS = 1e8
"""Condition of the eigenvectors from which on (critically damped pairs) each frequency is solved by itself."""
BLOCK = 64  # poses of one call of a thread


def receptance(modes: TipModes, frequency: Floats, threads: int | None = None) -> Complex:
    """(n, frequencies, 6, 6) m/N and the like at (frequencies,) Hz; NaN where the pose failed.

    At 0 Hz structural damping does not count: the compliance there is real.
    """
    n, f = len(modes.square), len(frequency)
    out = np.empty((n, f, 6, 6), complex)
    solve = _real_modes if modes.proportional else _poles
    s = np.asarray(2j * np.pi * frequency, complex)

    def block(first: int) -> None:
        rows = np.arange(first, min(n, first + BLOCK))
        ok = np.isfinite(modes.rest[rows, 0, 0])
        out[rows[~ok]] = complex(np.nan, np.nan)
        if ok.any():
            out[rows[ok]] = solve(modes.only(rows[ok]), s)

    with ThreadPoolExecutor(thread_count(threads)) as pool:
        list(pool.map(block, range(0, n, BLOCK)))
    return out


def _real_modes(m: TipModes, s: Complex) -> Complex:
    square, tip = m.square, m.tip
    n, k = square.shape
    each = np.einsum("nik,njk->nkij", tip, tip).reshape(n, k, 36)
    c = np.einsum("nkk->nk", m.viscous)
    w = s.imag
    real, imag = 1 - square[:, None, :] * w[:, None] ** 2, c[:, None, :] * w[:, None]
    size = real**2 + imag**2
    out = np.empty((n, len(s), 36), complex)
    out.real = (real / size) @ each + m.rest.reshape(n, 1, 36)
    out.imag = -(imag / size) @ each
    return out.reshape(n, len(s), 6, 6)


def _poles(m: TipModes, s: Complex) -> Complex:
    square, tip = m.square, m.tip
    n, k = square.shape
    eye = np.broadcast_to(np.eye(k), (n, k, k))
    inverse = np.linalg.inv(eye + 1j * m.loss)
    companion = np.zeros((n, 2 * k, 2 * k), complex)
    companion[:, :k, k:] = eye
    companion[:, k:, :k] = -inverse * square[:, None, :]
    companion[:, k:, k:] = -inverse @ m.viscous
    nu, X = np.linalg.eig(companion)
    good = np.linalg.cond(X) < WORST_BASIS
    out = np.empty((n, len(s), 6, 6), complex)
    if good.any():
        nu_, X_ = nu[good], X[good]
        b = tip[good].astype(complex)
        left = b @ X_[:, :k]
        right = np.linalg.solve(X_, np.concatenate([np.zeros_like(inverse[good]), inverse[good]], axis=1))
        right = right @ b.transpose(0, 2, 1)
        residue = np.einsum("nij,njl->njil", left, right).reshape(len(b), 2 * k, 36)
        weight = s[:, None] * nu_[:, None, :] ** 2 / (1 - s[:, None] * nu_[:, None, :])
        still = b @ inverse[good] @ b.transpose(0, 2, 1) + m.rest[good]
        out[good] = (weight @ residue).reshape(len(b), len(s), 6, 6) + still[:, None]
    for i in np.flatnonzero(~good):
        out[i] = direct(m, int(i), s)
    zero = s == 0
    if zero.any():
        out[:, zero] = (tip @ tip.transpose(0, 2, 1) + m.rest)[:, None]
    return out


def direct(m: TipModes, i: int, s: Complex) -> Complex:
    """(frequencies, 6, 6) of the pose i, by one linear system for each frequency."""
    k = m.square.shape[1]
    sign = np.sign(s.imag)[:, None, None]
    dynamic = (
        np.eye(k) + s[:, None, None] * m.viscous[i] + s[:, None, None] ** 2 * np.diag(m.square[i])
        + 1j * sign * m.loss[i]
    )  # fmt: skip
    tip = m.tip[i].astype(complex)
    return np.asarray(tip @ np.linalg.solve(dynamic, np.broadcast_to(tip.T, (len(s), k, 6))) + m.rest[i])


KINDS = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Displacement, velocity, acceleration by force: derivatives of a receptance by time."""


@keywords_of(tip_modes)
def frequency_response(
    machine: Machine | Source,
    position: ArrayLike,
    frequencies: ArrayLike,
    wrench: ArrayLike | None = None,
    *,
    kind: str = "receptance",
    **call: Any,
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
    machine = as_machine(machine)
    f = frequency_axis(frequencies)
    one_of(kind, KINDS, "kind")
    found = tip_modes(machine, position, wrench, **call)
    values = receptance(found, f, call.get("threads"))
    if KINDS[kind]:
        values *= ((2j * np.pi * f) ** KINDS[kind])[:, None, None]
    batch = found.shape
    poses = batch_dims(len(batch))
    attrs: dict[str, object] = {
        "machine": machine.name, "point": call.get("point", "tcp"), "kind": kind, "axes": "base axes, linear part first, SI",
        "damping": found.damping.said,
        "modal": "real modes" if found.proportional else "complex modes: the damping couples them",
    }  # fmt: skip
    worst = float(np.nanmax(found.unsymmetric, initial=0.0))
    if worst > SYMMETRIC:
        attrs["unsymmetric"] = worst
        attrs["symmetrised"] = "the symmetric part of the loaded stiffness was taken"
    dims = (*poses, "frequency", "response", "force")
    coords = {
        "frequency": ("frequency", f, {"units": "Hz"}), "response": list(TASK), "force": list(WRENCH),
        "status": (poses, found.status.reshape(batch)),
    }  # fmt: skip
    return xr.DataArray(values.reshape(*batch, *values.shape[1:]), coords, dims, kind, attrs)


def frequency_axis(frequencies: ArrayLike, name: str = "frequencies") -> Floats:
    """(frequencies,) Hz; StiffmapError unless finite, rising and not negative."""
    return rising(frequencies, name, "rising frequencies (Hz) from 0 on", above=np.nextafter(0.0, -1.0))

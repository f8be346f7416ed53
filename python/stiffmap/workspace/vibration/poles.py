"""Receptance at many frequencies from the modes at a tool: real modes in closed form, others by their poles (docs/theory.md V3)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats, thread_count
from stiffmap.workspace.vibration.modes import TipModes

Complex = NDArray[np.complex128]
WORST_BASIS = 1e8
"""Condition of the eigenvectors from which on (critically damped pairs) each frequency is solved by itself."""
BLOCK = 64
"""Poses of one call of a thread."""


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
        out[rows[~ok]] = np.nan
        if ok.any():
            out[rows[ok]] = solve(_rows(modes, rows[ok]), s)

    with ThreadPoolExecutor(thread_count(threads)) as pool:
        list(pool.map(block, range(0, n, BLOCK)))
    return out


def _rows(m: TipModes, rows: NDArray[np.intp]) -> dict[str, Any]:
    return {k: getattr(m, k)[rows] for k in ("square", "tip", "viscous", "loss", "rest")}


def _real_modes(m: dict[str, Floats], s: Complex) -> Complex:
    square, tip = m["square"], m["tip"]
    n, k = square.shape
    each = np.einsum("nik,njk->nkij", tip, tip).reshape(n, k, 36)
    c = np.einsum("nkk->nk", m["viscous"])
    w = s.imag
    real, imag = 1 - square[:, None, :] * w[:, None] ** 2, c[:, None, :] * w[:, None]
    size = real**2 + imag**2
    out = np.empty((n, len(s), 36), complex)
    out.real = (real / size) @ each + m["rest"].reshape(n, 1, 36)
    out.imag = -(imag / size) @ each
    return out.reshape(n, len(s), 6, 6)


def _poles(m: dict[str, Floats], s: Complex) -> Complex:
    square, tip = m["square"], m["tip"]
    n, k = square.shape
    eye = np.broadcast_to(np.eye(k), (n, k, k))
    inverse = np.linalg.inv(eye + 1j * m["loss"])
    companion = np.zeros((n, 2 * k, 2 * k), complex)
    companion[:, :k, k:] = eye
    companion[:, k:, :k] = -inverse * square[:, None, :]
    companion[:, k:, k:] = -inverse @ m["viscous"]
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
        still = b @ inverse[good] @ b.transpose(0, 2, 1) + m["rest"][good]
        out[good] = (weight @ residue).reshape(len(b), len(s), 6, 6) + still[:, None]
    for i in np.flatnonzero(~good):
        out[i] = direct({name: a[i] for name, a in m.items()}, s)
    zero = s == 0
    if zero.any():
        out[:, zero] = (tip @ tip.transpose(0, 2, 1) + m["rest"])[:, None]
    return out


def direct(m: dict[str, Floats], s: Complex) -> Complex:
    """(frequencies, 6, 6) of one pose, by one linear system for each frequency."""
    k = len(m["square"])
    sign = np.sign(s.imag)[:, None, None]
    dynamic = (
        np.eye(k) + s[:, None, None] * m["viscous"] + s[:, None, None] ** 2 * np.diag(m["square"])
        + 1j * sign * m["loss"]
    )  # fmt: skip
    tip = m["tip"].astype(complex)
    return np.asarray(tip @ np.linalg.solve(dynamic, np.broadcast_to(tip.T, (len(s), k, 6))) + m["rest"])

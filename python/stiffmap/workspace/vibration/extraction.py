"""Modal parameters of measured responses: frequencies, damping ratios and flexibilities with their uncertainty (docs/theory.md V7).

Least squares over poles, the residues being solved for each (variable projection; Golub and Pereyra 1973). Modes are added where the
misfit is largest as long as the Bayesian information criterion falls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import least_squares

from stiffmap.common.broadcasting import Floats
from stiffmap.common.tasks import on_one_thread
from stiffmap.workspace.vibration.files import MeasuredResponse
from stiffmap.workspace.vibration.response import Complex

MOST = 12  # modes in a band
PEAKS = 3  # places that are tried for a further mode before there is none
GAIN = 20.0  # fall of the information criterion that a mode is worth at least
RATIOS = (1e-4, 0.3)  # damping ratios of a mode; beyond them it is background
BEYOND = 1.5  # factor by which poles may lie outside the band; those are background
FLOOR = 1e-4  # noise at least, as a share of the response


@dataclass(frozen=True, eq=False)
class ExtractedModes:
    """Modes (n) that responses (m) share, lowest first, SI; `u_` are standard uncertainties."""

    frequency: Floats  # (n,) Hz, undamped
    u_frequency: Floats
    ratio: Floats  # (n,) damping ratio
    u_ratio: Floats
    flexibility: Floats
    """(n, m) m/N: residue by the square of the angular frequency, the share of the mode in the static flexibility."""
    u_flexibility: Floats


@on_one_thread
def extract_modes(responses: list[MeasuredResponse]) -> ExtractedModes:
    """Modes of responses at the same frequencies (frequency, Hz; receptance, m/N), by their coherence or, without, their scatter."""
    f = responses[0].frequency
    take = (f > 0) & np.all([np.isfinite(r.receptance) for r in responses], axis=0)
    f, H = f[take], np.array([r.receptance[take] for r in responses])
    fit = _Fit(f, H, np.array([_noise(r, take) for r in responses]))
    best, t = fit.criterion(np.zeros(0)), np.zeros(0)
    while len(t) < 2 * MOST and (more := fit.with_one_more(t)) is not None:
        better = fit.criterion(more)
        if not better < best - GAIN:
            break
        t, best = more, better
    return fit.answer(t)


def _noise(one: MeasuredResponse, take: np.ndarray) -> Floats:
    """(frequencies,) standard deviation of real and imaginary part."""
    H, v = one.receptance[take], one.variance()[take]
    scatter = np.pad(np.abs(np.diff(H, 4)) / np.sqrt(2 * 70), 2, mode="edge")  # 70: squares of 1, 4, 6, 4, 1
    local = median_filter(scatter, 31, mode="nearest") / 0.83  # median of a Rayleigh distribution to its rms
    coherent = np.sqrt(
        median_filter(v * np.abs(H) ** 2, 9, mode="nearest")
    )  # of one point it scatters as the response does
    return np.asarray(np.hypot(np.where(np.isfinite(coherent), coherent, local), FLOOR * np.abs(H)))


class _Fit:
    """Poles t: logarithms of frequencies (Hz), then of damping ratios."""

    def __init__(self, f: Floats, H: Complex, sigma: Floats) -> None:
        self.f, self.H, self.sigma = f, H, sigma
        self.least = 2 * float(((FLOOR * np.abs(H) / sigma) ** 2).sum())

    def basis(self, t: Floats) -> Complex:
        """(frequencies, 2 modes + 2): each pole with two real coefficients, modes above the band and those below it."""
        frequency, ratio = np.exp(t.reshape(2, -1))
        x = self.f[:, None] / frequency
        q = 1 / (1 - x**2 + 2j * ratio * x)
        far = np.stack([np.ones_like(self.f), (self.f[0] / self.f) ** 2], axis=1)
        return np.asarray(np.hstack([q, 1j * x * q, far]))

    def columns(self, t: Floats) -> list[Floats]:
        """Of each response (2 frequencies, coefficients), by its noise."""
        A = self.basis(t)
        return [np.concatenate([A.real / s[:, None], A.imag / s[:, None]]) for s in self.sigma]

    def solved(self, t: Floats) -> tuple[list[Floats], Floats]:
        """Coefficients, and misfit (responses, 2 frequencies) by noise, of each response."""
        coefficients, misfit = [], []
        for B, h, s in zip(self.columns(t), self.H, self.sigma, strict=True):
            y = np.concatenate([h.real / s, h.imag / s])
            c = np.linalg.lstsq(B, y, rcond=1e-12)[0]
            coefficients.append(c)
            misfit.append(B @ c - y)
        return coefficients, np.array(misfit)

    def criterion(self, t: Floats) -> float:
        """Bayesian information criterion, the level of the noise being free down to its floor."""
        r, n = self.solved(t)[1], 2 * self.H.size
        misfit, free = max((r**2).sum(), self.least), len(t) + len(self.H) * len(t)
        return float(n * np.log(misfit / n) + free * np.log(n))

    def with_one_more(self, t: Floats) -> Floats | None:
        """Poles with one more, fitted, at the most promising place where all stay within their bounds; None: nowhere."""
        r = self.solved(t)[1].reshape(len(self.H), 2, -1)
        power = uniform_filter1d((r**2).sum(axis=(0, 1)), 3)
        for _ in range(PEAKS):
            k = int(np.argmax(power))
            power[np.abs(np.log(self.f / self.f[k])) < 0.05] = 0.0
            a, b = t.reshape(2, -1)
            start = np.r_[a, np.log(self.f[k]), b, np.log(0.02)]
            n = len(start) // 2
            low, high = (
                np.log(np.r_[np.full(n, a), np.full(n, b)])
                for a, b in ((self.f[0] / BEYOND, RATIOS[0]), (self.f[-1] * BEYOND, RATIOS[1]))
            )
            fit = least_squares(
                lambda x: self.solved(x)[1].ravel(), np.clip(start, low + 1e-6, high - 1e-6),
                bounds=(low, high), max_nfev=30,
            )  # fmt: skip
            if ((fit.x > low + 1e-3) & (fit.x < high - 1e-3)).all():
                return np.asarray(fit.x)
        return None

    def answer(self, t: Floats) -> ExtractedModes:
        """Modes by frequency; the level of the noise is that of the misfit."""
        n = len(t) // 2
        c, r = self.solved(t)
        moved = [self.solved(t + 1e-5 * e) for e in np.eye(2 * n)]
        J = np.array([(m[1] - r).ravel() for m in moved]).reshape(2 * n, r.size).T / 1e-5
        level = max((r**2).sum(), self.least) / max(1, r.size - 2 * n - len(r) * (2 * n + 2))
        C = level * np.linalg.pinv(J.T @ J)
        flexibility, u = np.zeros((n, len(r))), np.zeros((n, len(r)))
        for j, B in enumerate(self.columns(t)):
            own = np.linalg.pinv(B.T @ B)
            G = np.array([(m[0][j] - c[j])[:n] for m in moved]).reshape(2 * n, n).T / 1e-5
            flexibility[:, j] = c[j][:n]
            u[:, j] = np.sqrt(np.diag(level * own)[:n] + np.einsum("ik,kl,il->i", G, C, G))
        (f, ratio), (u_f, u_ratio) = np.exp(t.reshape(2, -1)), np.sqrt(np.diag(C)).reshape(2, -1)
        by = np.argsort(f)
        by = by[(f[by] > self.f[0]) & (f[by] < self.f[-1])]
        return ExtractedModes(f[by], (f * u_f)[by], ratio[by], (ratio * u_ratio)[by], flexibility[by], u[by])

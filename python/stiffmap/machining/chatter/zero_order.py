"""Limits of a stable cut by the mean of the directional factors, in closed form (docs/theory.md V4; Altintas and Budak), and mode
coupling without regeneration: eigenvalues of M and K - Kp f n' (docs/theory.md V6; Gasparetto; Pan, Zhang et al.)."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from math import pi

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError, frames_of_this_package
from stiffmap.machining.chatter.cut import (
    ToolModes,
    cut_axes,
    mean_chips,
    milling_process,
    mode_rows,
    spindle_speed,
)
from stiffmap.machining.process.description import Process
from stiffmap.machining.process.load import GivenProcess

Response = Callable[[Floats], np.ndarray]
"""Receptance (frequencies, 3, 3) m/N in the axes of the cut at (frequencies,) Hz."""
FEED, TOOL = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
"""Directions of the feed and from the tool's tip to its holder where none is given, base axes."""
SEARCHED = 20_000
"""Frequencies between the samples, in all."""
MOST_TERMS, EXACT = 80, 1e-10
"""Of a rational function through samples; largest error, as a share of the largest value."""
DEEPEST = 1.0
"""m: a limit of mode coupling beyond it is none."""
ZOOMS, AROUND = 4, 400
"""Times that a least limit is looked at more closely, and frequencies close to each mode."""


def limiting_depth(
    receptance: xr.DataArray | ToolModes | Iterable[object],
    process: GivenProcess,
    *,
    speed: float | str | None = None,
    feed: ArrayLike = FEED,
    tool: ArrayLike = TOOL,
) -> Floats | float:
    """Depth below which a cut is stable, m: at every speed of the spindle, or at one.

    Parameters
    ----------
    receptance
        From `frequency_response`, dimensions (..., frequency, 6, 6), base axes: the answer has the batch axes (...).
        Or modes as of `floquet_multiplier`, in the axes of the cut: the answer is one number.
    process
        Tool, law and cut: a `Process`, a name, a file or a mapping.
    speed
        Spindle, rad/s, or text such as '5000 rpm'; None: the least depth over all speeds.
    feed, tool
        (3,) directions of the feed and from the tool's tip to its holder, base axes; of a receptance only.

    Infinite where nothing that vibrates can chatter, NaN where a pose failed. Between the samples of a receptance a rational function
    through them is searched; where there is none, as with noise or few samples, a warning says that the depth is an estimate. Zero order: the mean of the directional
    factors; for low immersion ask `floquet_multiplier`. Raises StiffmapError for bad input. Source: docs/theory.md, V4.
    """
    p, modes = milling_process(process), None
    if isinstance(receptance, xr.DataArray):
        frequency, values = _from_array(receptance)
        axes = cut_axes(feed, tool)
        G = axes @ values[..., :3, :3] @ axes.T
    else:
        modes = mode_rows(receptance)
        frequency = frequencies_of(modes.frequency)
        G = modes.receptance(frequency)
    period = None if speed is None else np.array([2 * pi / (p.tool.teeth * spindle_speed(speed, p))])
    out = np.full(G.shape[:-3], np.nan)
    for i in np.argwhere(np.isfinite(G).all(axis=(-1, -2, -3))):  # a mode may lie between two samples
        f, response = (frequency, modes.receptance) if modes else _between(frequency, G[*i])
        out[*i] = (
            least_depth(f, response, p)
            if period is None
            else at_periods(f, *limits(response(f), p), period)[0]
        )
    return float(out) if out.ndim == 0 else out


def _from_array(receptance: xr.DataArray) -> tuple[Floats, np.ndarray]:
    if "frequency" not in receptance.dims or receptance.shape[-2:] not in ((6, 6), (3, 3)):
        raise StiffmapError(
            "receptance: expected an array of frequency_response, dimensions (..., frequency, 6, 6), got "
            f"{dict(receptance.sizes)}"
        )
    if receptance.attrs.get("kind", "receptance") != "receptance":
        raise StiffmapError(f"receptance: expected a receptance (m/N), got {receptance.attrs['kind']}")
    f = np.asarray(receptance.frequency.values, dtype=float)
    if len(f) < 3:
        raise StiffmapError("receptance: expected three frequencies or more")
    return f[f > 0], receptance.values[..., f > 0, :, :]


def frequencies_of(own: Floats) -> Floats:
    """Hz, dense around each mode of frequencies (modes,) Hz."""
    widths = np.sinh(np.linspace(-4, 4, AROUND)) / np.sinh(4)
    close = own[:, None] * (1 + 0.5 * widths)
    low, high = 0.2 * own.min(), 4 * own.max()
    return np.unique(np.concatenate([close.ravel(), np.geomspace(low, high, 4 * AROUND)]))


def least_depth(frequency: Floats, response: Response, process: Process) -> float:
    """m: least limit of a receptance over all frequencies, first of some (Hz), then ever closer to the least; infinite: none."""
    least = np.inf
    for _ in range(ZOOMS):
        depth = limits(response(frequency), process)[0].min(axis=-1)
        k = int(np.argmin(depth))
        least = min(least, float(depth[k]))
        frequency = np.linspace(frequency[max(k - 1, 0)], frequency[min(k + 1, len(depth) - 1)], 33)
    return least


def _between(frequency: Floats, G: np.ndarray) -> tuple[Floats, Response]:
    """More frequencies, and the rational function through G (frequencies, 3, 3) by few of its samples (AAA; Nakatsukasa, Sète and
    Trefethen 2018); where there is none, as with noise, the nearest sample."""
    values = G.reshape(len(G), -1)
    size = np.abs(values).max()
    fit, chosen = np.broadcast_to(values.mean(axis=0), values.shape), []
    for _ in range(min(MOST_TERMS, len(G) // 3)):
        chosen.append(int(np.argmax(np.abs(values - fit).max(axis=1))))
        rest = np.setdiff1d(np.arange(len(G)), chosen)
        q, f = values[chosen], frequency[chosen]
        cauchy = 1 / (frequency[rest, None] - f)
        loewner = np.swapaxes((values[rest, None] - q) * cauchy[..., None], 1, 2).reshape(-1, len(chosen))
        w = np.linalg.svd(loewner, full_matrices=False)[2][-1].conj()
        fit = values.copy()
        fit[rest] = (cauchy * w) @ q / (cauchy @ w)[:, None]
        if np.abs(values - fit).max() <= EXACT * size:

            def at(x: Floats, w: np.ndarray = w, f: Floats = f, q: np.ndarray = q) -> np.ndarray:
                with np.errstate(divide="ignore", invalid="ignore"):
                    c = w / (x[:, None] - f)
                    return np.asarray((c @ q / c.sum(axis=1, keepdims=True)).reshape(-1, 3, 3))

            share = np.linspace(0, 1, max(20, SEARCHED // len(G)) + 2)[1:-1]
            return (frequency[:-1, None] + np.diff(frequency)[:, None] * share).ravel(), at
    text = f"receptance: no rational function passes through its {len(G)} samples: the depth is an estimate, maybe too deep"
    warnings.warn(text, stacklevel=frames_of_this_package())
    return frequency, lambda x: G[np.abs(frequency - x[:, None]).argmin(axis=1)]


def limits(G: np.ndarray, process: Process) -> tuple[Floats, Floats]:
    """(..., frequencies, 2) depth m (infinite: none) and the angle of a wave over a tooth period, rad, of G (..., 3, 3)."""
    seen = G[..., :2, :] @ mean_chips(process)
    trace = seen[..., 0, 0] + seen[..., 1, 1]
    product = seen[..., 0, 0] * seen[..., 1, 1] - seen[..., 0, 1] * seen[..., 1, 0]
    root = np.sqrt((trace / 2) ** 2 - product + 0j)
    eigen = np.stack([trace / 2 + root, trace / 2 - root], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / eigen
        depth = np.where(inverse.real > 0, (inverse.real**2 + inverse.imag**2) / (2 * inverse.real), np.inf)
        angle = 2 * np.arctan2(inverse.real, inverse.imag)
    return np.where(np.isfinite(depth), depth, np.inf), angle


def at_periods(frequency: Floats, depth: Floats, angle: Floats, period: Floats) -> Floats:
    """(..., periods) m: least depth where whole waves and the angle fill a tooth period (s); infinite: none."""
    turns = np.expand_dims(frequency, -1)[:, None] * period - angle[..., None] / (2 * pi)
    whole = np.floor(turns)
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.diff(turns, axis=-3)
        crossed = (np.abs(np.diff(whole, axis=-3)) == 1) & (np.abs(rise) < 1)
        level = np.maximum(whole[..., 1:, :, :], whole[..., :-1, :, :])
        share = np.where(crossed, (level - turns[..., :-1, :, :]) / rise, 0.0)
        a, b = depth[..., :-1, :, None], depth[..., 1:, :, None]
        between = np.where(crossed & np.isfinite(a) & np.isfinite(b), a + share * (b - a), np.inf)
    return np.asarray(np.min(between, axis=(-2, -3)))


def coupled_growth(m: ToolModes, p: Process, depth: float) -> float:
    """1/s, largest real part of the eigenvalues of the cut at a depth (m), with damping: above zero unstable."""
    own = 2 * np.pi * m.frequency
    square = np.diag(own**2) - depth * (m.way @ mean_chips(p) @ m.way[:, :2].T) / m.mass[:, None]
    first = np.block([[np.zeros_like(square), np.eye(len(m))], [-square, -np.diag(2 * m.ratio * own)]])
    return float(np.linalg.eigvals(first).real.max())


def coupling_depth(modes: ToolModes | Iterable[object], process: GivenProcess) -> float:
    """m: least depth at which modes couple with damping, to 1e-6 of it; infinite where there is none up to 1 m."""
    m, p = mode_rows(modes), milling_process(process)
    depths = np.geomspace(1e-6, DEEPEST, 400)
    bad = next((i for i, a in enumerate(depths) if coupled_growth(m, p, a) > 0), None)
    if bad is None:
        return float("inf")
    low, high = (0.0 if bad == 0 else depths[bad - 1]), depths[bad]
    while high - low > max(1e-6 * high, 1e-18):  # without damping there is no least depth
        middle = (low + high) / 2
        low, high = (low, middle) if coupled_growth(m, p, middle) > 0 else (middle, high)
    return float(high)

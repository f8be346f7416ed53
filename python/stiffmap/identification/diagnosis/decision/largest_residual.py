"""Where a pattern in the residual sits: the pose where it is largest, its period, its step, its slope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.field import unit
from stiffmap.experiment.noise.level import Mask
from stiffmap.identification.diagnosis.decision.patterns import Pattern

STEP_SHARE = 0.8
"""A single step that explains this share of what waves explain is the simpler description."""


def located(pattern: Pattern, e: Experiment, residual: Floats, sigma: Floats) -> Pattern:
    """The pattern with the pose where its axis is worst, and words on period, step or slope.

    residual, sigma
        (n, c) SI, NaN where a row is an outlier.
    """
    names = [c.name for c in e.channels]
    if pattern.axis not in names:
        return pattern
    axis = names.index(pattern.axis)
    good = np.isfinite(residual[:, axis])
    y = residual[good, axis]
    at, size = worst_pose(e, good, y, sigma[good, axis])
    return replace(
        pattern, detail=_words(pattern.what, e, good, y, f"µ{e.channels[axis].unit}"), position=at, size=size
    )


def worst_pose(
    e: Experiment, good: Mask, y: Floats, sigma: Floats
) -> tuple[tuple[float, float, float], float]:
    """Commanded position (m) of the pose whose readings are longest in standard deviations, and its rms."""
    groups = e.groups[good]
    count = np.maximum(np.bincount(groups), 1)
    score = np.where(np.bincount(groups) > 0, np.bincount(groups, (y / sigma) ** 2) / count, 0.0)
    worst = int(np.argmax(score))
    x, y_, z = (float(v) for v in e.position[good][groups == worst][0])
    return (x, y_, z), float(np.sqrt(np.mean(y[groups == worst] ** 2)))


def _words(what: str, e: Experiment, good: Mask, y: Floats, micro: str) -> str:
    if what.startswith("waves"):
        name = what.split()[-1]
        series = {"order": e.order, "temperature": e.temperature}.get(name)
        x = e.position[:, "xyz".index(name)] if name in "xyz" else series
        assert x is not None
        return _wave(name, x[good], y, micro)
    if what == "linear trend over the workspace":
        slopes = np.linalg.lstsq(np.column_stack([np.ones(len(y)), unit(e.position[good])]), y, rcond=None)[
            0
        ][1:]
        return ", ".join(f"{2e6 * s:+.1f} {micro} across {a}" for s, a in zip(slopes, "xyz", strict=True))
    return ""


def _wave(name: str, x: Floats, y: Floats, micro: str) -> str:
    factor, label = (1e3, "mm") if name in "xyz" else (1.0, "K" if name == "temperature" else "readings")
    total = float(np.sum((y - y.mean()) ** 2))
    tries = [_single(x, y, k) for k in np.arange(1.0, 12.01, 0.25)]
    left, period, amplitude = min(tries)
    share, edge, height = _step(x, y)
    if share > STEP_SHARE * (total - left):
        return f"a step of {1e6 * height:+.1f} {micro} at {name} = {factor * edge:.4g} {label}"
    return f"mostly a period of {factor * period:.3g} {label}, amplitude {1e6 * amplitude:.1f} {micro}"


def _single(x: Floats, y: Floats, halves: float) -> tuple[float, float, float]:
    """Sum of squares that one wave with so many half periods leaves, its period and amplitude."""
    phase = np.pi * halves * x / float(np.ptp(x))
    columns = np.column_stack([np.ones(len(y)), np.sin(phase), np.cos(phase)])
    a = np.linalg.lstsq(columns, y, rcond=None)[0]
    left = float(np.sum((y - columns @ a) ** 2))
    return left, 2.0 * float(np.ptp(x)) / halves, float(np.hypot(a[1], a[2]))


def _step(x: Floats, y: Floats) -> tuple[float, float, float]:
    """Drop of the sum of squares by the best step, its place and height."""
    order = np.argsort(x, kind="stable")
    xs, ys = x[order], y[order]
    n = len(ys)
    left = np.arange(1, n)
    before = np.cumsum(ys)[:-1]
    height = (ys.sum() - before) / (n - left) - before / left
    drop = np.where(np.diff(xs) > 0, height**2 * left * (n - left) / n, 0.0)
    i = int(np.argmax(drop))
    return float(drop[i]), float(xs[i] + xs[i + 1]) / 2, float(height[i])

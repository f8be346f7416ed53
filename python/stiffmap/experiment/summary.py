"""Sizes of residuals, in the words of a test report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import AXES, Floats


@dataclass(frozen=True)
class Summary:
    """Of single readings along the linear axes, m (rotations apart, rad)."""

    rms: float
    p95: float
    max: float
    per_axis: dict[str, float]
    """rms of each axis, m or rad."""
    n: int
    """Number of readings (linear and angular)."""
    ratio: float
    """rms over the noise floor, linear and angular readings together."""
    rotation_rms: float | None = None


def summary(residual: Floats, sigma: Floats) -> Summary:
    """Summary of residuals (n, 6), NaN where nothing was read."""
    linear, angular = residual[:, :3], residual[:, 3:]
    size = np.abs(linear[np.isfinite(linear)])
    if not size.size:
        size = np.array([np.nan])
    per_axis = {a: rms(residual[:, i]) for i, a in enumerate(AXES) if np.isfinite(residual[:, i]).any()}
    return Summary(
        rms=rms(linear),
        p95=float(np.percentile(size, 95)),
        max=float(size.max()),
        per_axis=per_axis,
        n=int(np.isfinite(residual).sum()),
        ratio=rms(residual / sigma),
        rotation_rms=rms(angular) if np.isfinite(angular).any() else None,
    )


def rms(values: Floats) -> float:
    """Root mean square of what is finite; NaN of nothing."""
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if good.size else float("nan")

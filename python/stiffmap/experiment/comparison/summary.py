"""Sizes of residuals, in the words of a test report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.channels import AXIS_CHANNELS, Channel, metres
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.noise.level import rms


@dataclass(frozen=True)
class Summary:
    """Of single readings of lengths, m (angles apart, rad)."""

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

    @property
    def size(self) -> tuple[float, str]:
        """rms in m of the lengths, or in rad where only angles are read; and that unit."""
        if self.rotation_rms is not None and not np.isfinite(self.rms):
            return self.rotation_rms, "rad"
        return self.rms, "m"


def summary(residual: Floats, sigma: Floats, channels: tuple[Channel, ...] = AXIS_CHANNELS) -> Summary:
    """Summary of residuals (n, c), NaN where nothing was read."""
    linear, angular = residual[:, metres(channels)], residual[:, ~metres(channels)]
    size = np.abs(linear[np.isfinite(linear)])
    if not size.size:
        size = np.array([np.nan])
    read = [i for i in range(len(channels)) if np.isfinite(residual[:, i]).any()]
    per_axis = {channels[i].name: rms(residual[:, i]) for i in read}
    return Summary(
        rms=rms(linear),
        p95=float(np.percentile(size, 95)),
        max=float(size.max()),
        per_axis=per_axis,
        n=int(np.isfinite(residual).sum()),
        ratio=rms(residual / sigma),
        rotation_rms=rms(angular) if np.isfinite(angular).any() else None,
    )

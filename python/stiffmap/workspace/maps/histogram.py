"""Percentiles of any number of positive values in bounded memory, whatever their order."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import Floats

BITS = 9
RELATIVE_WIDTH = 2.0**-BITS
"""Width of a bin against its lower edge, at most."""
_SHIFT = 52 - BITS


class Histogram:
    """Counts over bins that share a floating-point number's sign, exponent and leading bits."""

    def __init__(self) -> None:
        self.count: dict[int, int] = {}

    def add(self, values: Floats) -> None:
        """Count the values (n,), not negative; NaN are left out."""
        kept = np.ascontiguousarray(values[~np.isnan(values)], dtype=np.float64) + 0.0
        bins, counts = np.unique(kept.view(np.int64) >> _SHIFT, return_counts=True)
        for b, n in zip(bins.tolist(), counts.tolist(), strict=True):
            self.count[b] = self.count.get(b, 0) + n

    @classmethod
    def joined(cls, parts: Iterable[Histogram]) -> Histogram:
        """The counts of all."""
        out = cls()
        for part in parts:
            for b, n in part.count.items():
                out.count[b] = out.count.get(b, 0) + n
        return out

    def percentiles(self, percent: Floats) -> Floats:
        """Upper edges of the bins that hold the values of rank ceil(p n / 100); NaN where nothing was counted."""
        if not self.count:
            return np.full(percent.shape, np.nan)
        bins = np.array(sorted(self.count), dtype=np.int64)
        upto = np.cumsum([self.count[b] for b in bins.tolist()])
        rank: NDArray[np.float64] = np.maximum(np.ceil(percent / 100 * upto[-1]), 1)
        chosen = bins[np.searchsorted(upto, rank)]
        zero = chosen == 0  # the first bin begins at 0; a rigid machine stays there
        return np.where(zero, 0.0, ((chosen + 1) << _SHIFT).view(np.float64))

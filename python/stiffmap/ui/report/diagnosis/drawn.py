"""What the pictures of a report share: scales, colours, means of poses."""

from __future__ import annotations

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.identification.diagnosis.report.findings import Findings

UM, MM = 1e6, 1e3
BEFORE, AFTER = "#c1432e", "#2a6f97"


def kept(d: Findings, values: Floats) -> Floats:
    """(n, k) values, NaN in rows that were set aside."""
    return np.where(d.set_aside[:, None], np.nan, values)


def pose_means(e: Experiment, values: Floats) -> Floats:
    """(groups, k) mean of what is finite of each pose."""
    number = int(e.groups.max()) + 1
    good = np.isfinite(values)
    sums = np.stack(
        [np.bincount(e.groups, np.where(good, values, 0.0)[:, i], number) for i in range(values.shape[1])]
    )
    counts = np.stack([np.bincount(e.groups, good[:, i], number) for i in range(values.shape[1])])
    return np.asarray(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan).T)

"""Residuals as arrows at their poses."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.report.findings import Findings
from stiffmap.ui.plot.experiment import arrow_figure, kept, pose_means, vector_cases
from stiffmap.ui.plot.style import AFTER, BEFORE, UM


def vectors(d: Findings) -> Figure:
    """Mean residual vector of each pose, before and after, on one scale."""
    e = d.experiment

    # of loads along x, y or z, turned to one sign (else + and - would cancel), those that leave most
    def seen(values: Floats, weight: Floats) -> Floats:
        return pose_means(e, kept(d, values)[:, :3] * weight[:, None])

    cases = [(n, seen(d.residual_before, w), seen(d.residual_after, w)) for n, w in vector_cases(e)]
    case, before, after = max(cases, key=lambda c: float(np.nansum(c[1] ** 2)))
    told = "mean residual of each pose"
    both = ((f"before: {told}", before, BEFORE), (f"after: {told}", after, AFTER))
    figure, longest = arrow_figure(pose_means(e, e.position), both)
    figure.supxlabel(f"longest arrow: {longest * UM:.1f} µm{'; ' + case if case else ''}", fontsize=9)
    return figure

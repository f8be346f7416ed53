"""A picture of the plan: how the error of the diagonal falls with the number of nodes and with the force."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from stiffmap.common.outputs import write_picture
from stiffmap.model.link.arrays import Floats
from stiffmap.model.link.plan import planned_error
from stiffmap.model.link.report import unit_factor, unit_name

matplotlib.use("Agg", force=False)
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9")
STYLES = ("-", "--", ":", "-.", (0, (5, 1)), (0, (1, 1)))


def draw_plan(points: Floats, wrenches: Floats, reference: Floats, sigma: float, path: str | Path) -> None:
    """Write a PNG: standard error of k11..k66 over the number of nodes and over a factor on the wrenches.

    Args as in :func:`stiffmap.model.link.plan.planned_error`; units of the picture mm/N and rad/(N·mm).
    """
    from matplotlib import pyplot as plt

    error = np.diag(planned_error(points, wrenches, reference, sigma) * unit_factor("mm"))
    nodes, force = np.geomspace(3, 3000, 60), np.geomspace(0.1, 10, 60)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), sharey=True, layout="constrained")
    for i in range(6):
        style = {
            "color": COLOURS[i],
            "linestyle": STYLES[i],
            "label": f"k{i + 1}{i + 1} [{unit_name(i, i, 'mm')}]",
        }
        left.loglog(nodes, error[i] * np.sqrt(len(points) / nodes), **style)
        right.loglog(force, error[i] / force, **style)
    left.axvline(len(points), color="black", lw=0.6)
    right.axvline(1.0, color="black", lw=0.6)
    left.set(xlabel="independent nodes in the region", ylabel="standard error, units in the legend")
    right.set(xlabel="factor on the planned wrenches")
    left.set_title(f"noise {1e6 * sigma:.3g} µm; lines mark the plan")
    right.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(which="both", alpha=0.2)
    try:
        write_picture(path, figure, dpi=110)
    finally:
        plt.close(figure)

"""Internal wrenches of a machine that carries nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.internal_wrenches import InternalWrenches
from stiffmap.ui.plot.style import BLUE, CYCLE, VERMILLION, paper


def stress_figure(stress: InternalWrenches, title: str = "") -> Figure:
    """Forces (N, left) and moments (N·m, right) of every link spring at one pose, in the spring's axes."""
    if stress.status.shape != ():
        raise StiffmapError(f"stress: expected one pose, got {stress.status.shape}")
    names = list(stress.springs)
    values = np.array([stress.springs[n] for n in names]).reshape(len(names), 6)
    rows = np.arange(len(names))
    with paper(6.4, 1.2 + 0.24 * len(names), title or "internal wrenches, spring axes") as figure:
        axes: Any = figure.subplots(1, 2, sharey=True)
        for ax, first, unit in zip(axes, (0, 3), ("force, N", "moment, N m"), strict=True):
            for k in range(3):
                label = f"along or about {'xyz'[k]}" if first == 0 else None
                ax.barh(rows + 0.26 * (k - 1), values[:, first + k], height=0.24, label=label,
                        color=(BLUE, VERMILLION, CYCLE[2])[k])  # fmt: skip
            ax.axvline(0, color="0.3", lw=0.6)
            reach = 1.1 * max(float(np.nanmax(np.abs(values[:, first : first + 3]), initial=0.0)), 1e-6)
            ax.set(xlim=(-reach, reach), xlabel=unit, yticks=rows, yticklabels=names)
        axes[0].invert_yaxis()
    return figure

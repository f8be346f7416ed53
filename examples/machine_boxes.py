"""Every shipped machine over its workspace: softest translational stiffness, one panel each.

python examples/machine_boxes.py docs/img/machines/boxes.png
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.model.files import shipped_machines
from stiffmap.ui.plot import save
from stiffmap.ui.plot.style import MM, new_figure, paper_style

N = 21


def slice_of(machine: sm.Machine) -> tuple[Any, Any, tuple[str, str], sm.Solution]:
    """Two axes (mm or deg), their names, and the machine solved without load on their grid.

    x and y in the middle of the box; height and tilt where those are commanded; x alone for one axis.
    """
    low, high = machine.workspace
    task = machine.description.task
    across, up = np.linspace(low[0], high[0], N), np.linspace(low[1], high[1], N)
    names, rotation = ("x, mm", "y, mm"), None
    if "x" not in task:
        across, up, names = (
            np.linspace(low[2], high[2], N),
            np.radians(np.linspace(-15, 15, N)),
            ("z, mm", "rx, deg"),
        )
    elif "y" not in task:
        up = np.zeros(1)
    u, v = np.meshgrid(across, up)
    p = np.stack([u, v, 0 * u + (low[2] + high[2]) / 2], -1)
    if "x" not in task:
        p = np.stack([0 * u, 0 * u, u], -1)
        rotation = np.zeros((*u.shape, 3, 3)) + np.eye(3)
        rotation[..., 1, 1] = rotation[..., 2, 2] = np.cos(v)
        rotation[..., 2, 1], rotation[..., 1, 2] = np.sin(v), -np.sin(v)
        return MM * across, np.degrees(up), names, machine.solve(p, rotation=rotation)
    return MM * across, MM * up, names, machine.solve(p)


def main() -> None:
    """Draws and saves."""
    machines = [sm.load_machine(m.name) for m in shipped_machines()]
    with paper_style():
        figure = new_figure(11.0, 8.2)
        axes = figure.subplots(3, 4).ravel()
        for ax, machine in zip(axes, machines, strict=False):
            panel(figure, ax, machine)
        for ax in axes[len(machines) :]:
            ax.set_axis_off()
        figure.suptitle("softest translational stiffness, N/µm, without load (grey: no answer)", fontsize=10)
    save(figure, sys.argv[1], dpi=90)


def panel(figure: Any, ax: Any, machine: sm.Machine) -> None:
    """Stiffness in colours, or as a line where one axis is commanded."""
    across, up, names, s = slice_of(machine)
    known = s.ok
    block = np.where(known[..., None, None], s.compliance[..., :3, :3], np.eye(3))
    softest = np.where(
        known, 1e-6 / np.linalg.eigvalsh((block + np.swapaxes(block, -1, -2)) / 2)[..., -1], np.nan
    )
    ax.set_title(f"{machine.name}: {known.sum()} of {known.size} poses solved", fontsize=8)
    ax.set_xlabel(names[0])
    if len(up) == 1:
        ax.plot(across, softest[0])
        return
    ax.set_ylabel(names[1])
    ax.set_facecolor("0.8")
    figure.colorbar(ax.pcolormesh(across, up, softest, shading="nearest", cmap="viridis"), ax=ax)


if __name__ == "__main__":
    main()

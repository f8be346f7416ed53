"""A picture per link: deformed part, residual of the rigid fit, compliance with error bars. Plots in mm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from stiffmap.common.broadcasting import Floats
from stiffmap.model.link.pipeline import PartLink
from stiffmap.model.link.report import UNIT_FACTOR, unit_name
from stiffmap.model.link.result import Link
from stiffmap.model.link.transport import Ints, standard_errors
from stiffmap.ui.plot.style import BLUE, COLOURS, VERMILLION, new_figure, save, wrench_text

GREY = "#999999"
MOST_TRIANGLES = 6000


def draw_link(link: Link, path: str | Path, part: PartLink | None = None) -> None:
    """Write a PNG: a row of residual fields and the table with error bars; of a `part` that was computed, a row of deformed
    shapes above them."""
    cases = min(len(link.sigma), 6)
    figure = new_figure(17, 9 if part is None else 13)
    heights = (0.9, 1.5) if part is None else (1.0, 0.9, 1.5)
    rows: Any = figure.subfigures(len(heights), 1, height_ratios=heights)
    if part is not None:
        triangles = boundary_triangles(part.mesh.tets)
        for k in range(cases):
            _draw_shape(rows[0].add_subplot(1, cases, k + 1, projection="3d"), part, triangles, k)
    _draw_residuals(rows[-2], link, cases)
    error = link.standard_error if part is None else standard_errors(part.covariance)
    _draw_entries(rows[-1].add_subplot(), link, error)
    save(figure, path)


def boundary_triangles(tets: Ints) -> Ints:
    """(triangles, 3) corner nodes of the faces that belong to one tetrahedron only."""
    every = np.concatenate([tets[:, [0, 1, 2]], tets[:, [0, 1, 3]], tets[:, [0, 2, 3]], tets[:, [1, 2, 3]]])
    _, first, count = np.unique(np.sort(every, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(every[first[count == 1]])


def _draw_residuals(figure: SubFigure, link: Link, cases: int) -> None:
    """One panel per load case: residual vectors on the face, seen along its flattest direction."""
    field, residual = link.evidence.field, link.residual
    normal = int(np.argmin(np.ptp(field.points, axis=0)))
    a, b = (i for i in range(3) if i != normal)
    x, y = 1e3 * field.points[:, a], 1e3 * field.points[:, b]
    for k in range(cases):
        axes = figure.add_subplot(1, cases, k + 1)
        size = 1e6 * np.linalg.norm(residual[k], axis=1)
        dots = axes.scatter(x, y, c=size, s=12, cmap=COLOURS)
        axes.quiver(x, y, residual[k, :, a], residual[k, :, b], angles="xy", width=0.005)
        out = link.outliers[k]
        axes.plot(x[out], y[out], "x", color=VERMILLION, label="outlier")
        bar = figure.colorbar(dots, ax=axes, label="residual, µm", location="bottom")
        bar.ax.locator_params("x", nbins=3)
        axes.set(title=f"case {k + 1}", xlabel=f"{'xyz'[a]}, mm", aspect="equal")
        if k == 0:
            axes.set_ylabel(f"{'xyz'[b]}, mm")


def _draw_shape(axes: Axes3D, part: PartLink, triangles: Ints, case: int) -> None:
    step = max(1, len(triangles) // MOST_TRIANGLES)
    p, u = part.mesh.nodes, part.displacements[case]
    extent = np.ptp(p, axis=0).max()
    scale = 0.15 * extent / max(float(np.abs(u).max()), 1e-300)
    for nodes, colour, alpha in ((p, GREY, 0.25), (p + scale * u, BLUE, 0.8)):
        corners = 1e3 * nodes[triangles[::step]]
        axes.add_collection3d(Poly3DCollection(corners, facecolor=colour, alpha=alpha, lw=0))
    low, size = 1e3 * p.min(axis=0), np.maximum(1e3 * np.ptp(p, axis=0), 300 * extent)
    middle = low + 1e3 * np.ptp(p, axis=0) / 2
    for axis, centre, width in zip("xyz", middle, size, strict=True):
        getattr(axes, f"set_{axis}lim")(centre - 0.55 * width, centre + 0.55 * width)
        getattr(axes, f"set_{axis}label")(f"{axis}, mm", fontsize=7, labelpad=-3)
        # labels of a thin side would overlap
        axes.locator_params(axis=axis, nbins=4 if width > 0.5 * size.max() else 2)
    axes.set_box_aspect(size, zoom=0.8)  # room for the labels
    axes.tick_params(labelsize=6)
    axes.set_title(
        f"case {case + 1}: {wrench_text(part.wrenches[case])}\n(displacement × {scale:.0f})", fontsize=9
    )


def _draw_entries(axes: Axes, link: Link, error: Floats) -> None:
    """Entries over sqrt(kii kjj) with 95 % bars; the diagonal's values and units in the labels."""
    C, factor = link.compliance, UNIT_FACTOR
    size = np.sqrt(np.abs(np.outer(np.diag(C), np.diag(C))))
    at = tuple(np.hstack([np.diag_indices(6), np.triu_indices(6, 1)]))
    labels, y = [], np.arange(len(at[0]))[::-1]
    value, bar, zero = (C / size)[at], (1.96 * error / size)[at], np.asarray(link.insignificant, bool)[at]
    for i, j, is_zero in zip(*at, zero, strict=True):
        number = f"{C[i, j] * factor[i, j]:.3e} ± {error[i, j] * factor[i, j]:.0e} {unit_name(i, j)}"
        labels.append(f"k{i + 1}{j + 1} = {number}" + ("  (zero within the test)" if is_zero else ""))
    for chosen, colour in ((~zero, BLUE), (zero, GREY)):
        axes.errorbar(value[chosen], y[chosen], xerr=bar[chosen], fmt="o", color=colour, capsize=3)
    axes.axvline(0, color="black", lw=0.6)
    axes.set_yticks(y, labels, fontsize=8, family="monospace")
    axes.set_xlabel("entry / sqrt(kii kjj), with 95 % interval (± in the labels: one standard uncertainty)")
    axes.grid(axis="x", alpha=0.3)

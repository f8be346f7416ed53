"""Residuals as arrows at their poses."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from stiffmap.experiment.experiment import Floats
from stiffmap.identification.diagnosis.report.findings import Findings
from stiffmap.ui.pictures.experiment import FLAT, vector_cases
from stiffmap.ui.report.diagnosis.drawn import AFTER, BEFORE, MM, UM, kept, pose_means


def vectors(d: Findings) -> Figure:
    """Mean residual vector of each pose, before and after, on one scale."""
    figure = Figure(figsize=(10, 5.0))

    # of loads along x, y or z, turned to one sign (else + and - would cancel), those that leave most
    def seen(values: Floats, weight: Floats) -> Floats:
        return pose_means(d.experiment, kept(d, values) * weight[:, None])

    both = [
        (name, seen(d.residual_before, w), seen(d.residual_after, w))
        for name, w in vector_cases(d.experiment)
    ]
    case, before, after = max(both, key=lambda b: float(np.nansum(b[1][:, :3] ** 2)))
    at = pose_means(d.experiment, d.experiment.position) * MM
    longest = max(float(np.linalg.norm(np.nan_to_num(before[:, :3]), axis=1).max()), 1e-12)
    extent = float(np.ptp(at, axis=0).max())
    scale = 0.25 * max(extent, 1.0) / longest
    spread = [a for a in range(3) if np.ptp(at[:, a]) > FLAT * max(extent, 1.0)]
    if len(spread) < 3:
        _flat_vectors(figure, at, ((("before", before, BEFORE)), ("after", after, AFTER)), scale, spread)
        figure.text(0.5, 0.02, _longest(longest, case), ha="center", fontsize=9)
        return figure
    for i, (name, r, colour) in enumerate((("before", before, BEFORE), ("after", after, AFTER))):
        axes = figure.add_subplot(1, 2, i + 1, projection="3d")
        v = np.nan_to_num(r[:, :3]) * scale
        axes.quiver(*at.T, *v.T, color=colour, linewidth=1.2)
        axes.scatter(*at.T, s=6, color="0.4")
        axes.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm", title=f"{name}: mean residual of each pose")
        axes.tick_params(labelsize=8)
        axes.locator_params(nbins=5)
        axes.set_box_aspect(None, zoom=0.85)  # room for the label of z
    figure.subplots_adjust(left=0.02, right=0.95, bottom=0.1, top=0.93, wspace=0.12)
    figure.text(0.5, 0.025, _longest(longest, case), ha="center", fontsize=9)
    return figure


def _longest(longest: float, case: str) -> str:
    return f"longest arrow before: {longest * UM:.1f} µm{'; ' + case if case else ''}"


def _flat_vectors(
    figure: Figure, at: Floats, pairs: tuple[tuple[str, Floats, str], ...], scale: float, spread: list[int]
) -> None:
    """Arrows in the plane in which poses lie (a line or a point of them: with the axis of the largest residual)."""
    sizes = np.nansum(pairs[0][1][:, :3] ** 2, axis=0)
    more = [int(a) for a in np.argsort(-sizes, kind="stable") if a not in spread]
    a, b = sorted([*spread, *more][:2])
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    ends = [at[:, [a, b]]] + [at[:, [a, b]] + np.nan_to_num(r[:, [a, b]]) * scale for _, r, _ in pairs]
    low, high = np.vstack(ends).min(axis=0), np.vstack(ends).max(axis=0)
    room = 0.08 * max(float((high - low).max()), 1.0)
    for ax, (name, r, colour) in zip(axes, pairs, strict=True):
        v = np.nan_to_num(r[:, [a, b]]) * scale
        ax.quiver(*at[:, [a, b]].T, *v.T, angles="xy", scale_units="xy", scale=1, color=colour, width=0.005)
        ax.plot(at[:, a], at[:, b], ".", ms=4, color="0.4")
        ax.set(
            xlabel=f"{'xyz'[a]}, mm", ylabel=f"{'xyz'[b]}, mm", title=f"{name}: mean residual of each pose"
        )
        ax.set_xlim(low[0] - room, high[0] + room)
        ax.set_ylim(low[1] - room, high[1] + room)
        ax.set_aspect("equal", adjustable="box")
    figure.subplots_adjust(left=0.09, right=0.97, bottom=0.17, top=0.92, wspace=0.2)

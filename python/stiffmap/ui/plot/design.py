"""Pictures of a Pareto set: fronts, parallel coordinates, progress."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from matplotlib.figure import Figure

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.style import BLUE, COLOURS, CYCLE, MM, SKY, VERMILLION, paper
from stiffmap.workspace.design.search import ParetoSet
from stiffmap.workspace.performance.registry import get_measure
from stiffmap.workspace.performance.table import BoxMap, MeasuresTable, box_map, levels

MAPPED = ("deflection", "frequency", "transmission_max")


def front_figure(found: ParetoSet) -> Figure:
    """Each pair of objectives; the chosen designs marked."""
    names = found.design.model.objectives
    pairs = list(combinations(range(len(names)), 2)) or [(0, 0)]
    values = np.array([[get_measure(n).factor * j.values[n] for n in names] for j in found.judged])
    title = f"{found.design.model.name}: {len(found.x)} designs that no other one betters"
    with paper(3.6 * len(pairs), 3.2, title, most=0) as figure:
        for axes, (a, b) in zip(figure.subplots(1, len(pairs), squeeze=False)[0], pairs, strict=True):
            axes.plot(values[:, a], values[:, b], "o", color=SKY, markersize=4)
            for colour, (label, i) in zip(CYCLE[1:], found.chosen().items(), strict=False):
                axes.plot(values[i, a], values[i, b], "s", color=colour, markersize=6, label=label)
            axes.set(xlabel=_axis(names[a]), ylabel=_axis(names[b]))
            axes.legend()
    return figure


def parallel_figure(found: ParetoSet) -> Figure:
    """Variables and objectives of every design, each scaled to its range in the set."""
    names = list(found.judged[0].values)
    table = np.hstack([found.x, [[get_measure(n).factor * j.values[n] for n in names] for j in found.judged]])
    labels = [*found.design.variables, *names]
    low, high = table.min(axis=0), table.max(axis=0)
    scaled = (table - low) / np.where(high > low, high - low, 1)
    title = f"{found.design.model.name}: variables and measures, each from its lowest to its highest"
    with paper(max(6.0, 0.9 * len(labels)), 3.4, f"{title}; red: compromise", most=0) as figure:
        axes = figure.add_subplot()
        axes.plot(scaled.T, color=BLUE, alpha=0.25, linewidth=0.8)
        axes.plot(scaled[found.chosen()["compromise"]], color=VERMILLION, linewidth=1.6)
        ranges = [f"{n}\n{a:.4g}…{b:.4g}" for n, a, b in zip(labels, low, high, strict=True)]
        axes.set_xticks(range(len(labels)), ranges, rotation=60, ha="right")
        axes.set_yticks([])
    return figure


def progress_figure(found: ParetoSet) -> Figure:
    """Hypervolume against evaluations."""
    steps = np.array(found.history)
    with paper(4.2, 3.0, most=0) as figure:
        axes = figure.add_subplot()
        axes.plot(steps[:, 1], steps[:, 2], color=BLUE)
        axes.set(xlabel="designs evaluated", ylabel="hypervolume")
    return figure


def comparison_figure(tables: Mapping[str, MeasuresTable]) -> Figure:
    """Maps on the middle plane of the box, a row per measure and a column per machine; one scale per row."""
    found = {n: {k: m for k, t in tables.items() if (m := _map(t, n)) is not None} for n in MAPPED}
    rows = {name: maps for name, maps in found.items() if len(maps) == len(tables)}
    if not rows:
        raise StiffmapError(f"no maps to set side by side; asked for {', '.join(MAPPED)}")
    with paper(2.2 * len(tables) + 0.8, 2.3 * len(rows) + 0.4, most=0) as figure:
        grid = figure.subplots(len(rows), len(tables), squeeze=False)
        for line, (name, maps) in zip(grid, rows.items(), strict=True):
            steps = levels(*map(_middle, maps.values()))
            for axes, (machine, m) in zip(line, maps.items(), strict=True):
                drawn = axes.contourf(MM * m.x, MM * m.y, _middle(m).T, levels=steps, cmap=COLOURS)
                axes.set(aspect="equal", title=machine, xlabel="x, mm")
            line[0].set_ylabel("y, mm")
            figure.colorbar(drawn, ax=list(line), label=_axis(name))
        figure.suptitle("Middle plane of the box")
    return figure


def _map(table: MeasuresTable, name: str) -> BoxMap | None:
    row = next((r for r in table.rows if r.measure.name == name), None)
    over = None if row is None else box_map(row)
    return None if over is None or min(len(over.x), len(over.y)) < 2 else over


def _middle(over: BoxMap) -> Floats:
    return np.asarray(over.values[:, :, len(over.z) // 2])


def _axis(name: str) -> str:
    m = get_measure(name)
    return f"{name}, {m.shown}" if m.shown else name

"""Measures along the task's toolpath: compliance along its force, shares of the drives' efforts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.plot.style import BLACK, MM, headline, line_look, paper
from stiffmap.workspace.performance.motion.trajectory import way_along
from stiffmap.workspace.performance.table import MeasuresTable, Row

ALONG = ("path_compliance", "path_effort")


def path_rows(table: MeasuresTable) -> list[Row]:
    """Measures along the path that have values there."""
    return [r for r in table.rows if r.measure.name in ALONG and r.found.values is not None]


def path_measures_figure(tables: Mapping[str, MeasuresTable]) -> Figure:
    """A panel per measure over the way along the path: of one machine its drives, of several machines a line each.

    Raises StiffmapError where nothing was measured along a path.
    """
    names = [n for n in ALONG if any(r.measure.name == n for t in tables.values() for r in path_rows(t))]
    if not names:
        raise StiffmapError("no measure along a toolpath; asked for path_compliance, path_effort")
    one = len(tables) == 1
    with paper(6.4, 0.9 + 2.2 * len(names)) as figure:
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            for i, (machine, table) in enumerate(tables.items()):
                for row in path_rows(table):
                    if row.measure.name == name:
                        _lines(axes, row, machine, i, one)
            axes.set_ylim(bottom=0)
        panels[-1].set_xlabel("way along the path, mm")
        told = f"{next(iter(tables))}: along" if one else "Along"
        headline(figure, f"{told} the toolpath, with its force")
    return figure


def _lines(axes: Axes, row: Row, machine: str, number: int, one: bool) -> None:
    positions, values = row.found.positions, row.found.values
    assert positions is not None
    assert values is not None
    way = MM * way_along(positions)
    share = row.found.extra.get("share")
    if one and isinstance(share, np.ndarray):
        for j, drive in enumerate(row.found.extra["drives"]):  # type: ignore[arg-type, var-annotated]
            axes.plot(way, share[:, j], label=str(drive), **line_look(j))
    else:
        look = line_look(number) | ({"color": BLACK, "label": ""} if one else {"label": machine})
        axes.plot(way, row.measure.factor * values, **look)
    unit = "share of the declared effort" if share is not None else f"compliance, {row.measure.shown}"
    axes.set_ylabel(unit)
    limit = None if row.bound is None else row.bound.at_most
    if limit is not None and number == 0:
        axes.axhline(row.measure.factor * limit, color="0.4", linewidth=0.8, label="required: below")

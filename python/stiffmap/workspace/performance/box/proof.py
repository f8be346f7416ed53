"""Who decides cells: this process, or the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.tasks import workers
from stiffmap.workspace.performance.box.cell import Cells
from stiffmap.workspace.performance.box.enclosed import enclose
from stiffmap.workspace.performance.box.sampled import sample
from stiffmap.workspace.performance.limits.limits import Bounds

Judge = Callable[[Floats, Floats, Floats], Cells]
"""Of cells with centres (n, 3) m, half lengths (n, 3) m along the columns of axes (3, 3)."""
PER_TASK = 500
"""Cells of one task on a cluster; twice as many at least, or they are decided here."""


def judge_cells(bounds: Bounds) -> Judge:
    """Enclosure where it can be had, else nodes."""
    return partial(sample if bounds.unproven else enclose, bounds)


@contextmanager
def judge_on(bounds: Bounds, scheduler: Any = None) -> Iterator[Judge]:
    """The judge of cells; on a cluster the same cells get the same answer. Nodes are judged here: they begin at each other."""
    if scheduler is None or bounds.unproven:
        yield judge_cells(bounds)
        return
    alone = replace(bounds, threads=1, counter=[0], known=[])
    with workers(_some_cells, alone, scheduler=scheduler) as hands:

        def judge(centre: Floats, half: Floats, axes: Floats) -> Cells:
            n = len(centre)
            if n < 2 * PER_TASK:
                return enclose(bounds, centre, half, axes)
            bounds.counter[0] += n
            parts = [slice(k, k + PER_TASK) for k in range(0, n, PER_TASK)]
            found = hands.in_order((centre[k], half[k], axes) for k in parts)
            inside, broken, where, limit, bend = (
                np.concatenate([getattr(cells, name) for cells in found])
                for name in ("inside", "broken", "where", "limit", "bend")
            )
            return Cells(inside, broken, where, limit, found[0].names, bend)

        yield judge


def _some_cells(bounds: Bounds, cells: tuple[Floats, Floats, Floats]) -> Cells:
    """Enclosures, as a task."""
    return enclose(bounds, *cells)

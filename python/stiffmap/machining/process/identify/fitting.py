"""From a table of forces to a law: fits of all rivals, feeds left out, a test of the bend."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as fisher

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.machining.process.description import Process
from stiffmap.machining.process.identify.law import IdentifiedLaw
from stiffmap.machining.process.identify.models import BEND, KIENZLE, RUNOUT, STRAIGHT, Fitted, Model, fit
from stiffmap.machining.process.identify.runout import runout_of
from stiffmap.machining.process.identify.table import ForceTable, read_table


def identify_process(
    table: str | PathLike[str] | Mapping[str, Any], process: Process | None = None, sheet: str | None = None
) -> IdentifiedLaw:
    """Coefficients of the mechanistic law from a dynamometer's table: means per feed, or signals over time.

    table
        CSV file, workbook or columns ``feed_per_tooth_mm, Fx_N, Fy_N, Fz_N, teeth, axial_mm`` and, where the cut is no slot,
        ``side, radial_mm, diameter_mm``; signals also ``time_s, spindle_rpm``. Other units are ``Fx [kN]``,
        ``feed [mm/min]`` (with ``spindle_rpm``). Single values stand for all rows.
    process
        Gives tool, cut and speed where no column does.
    sheet
        Of a workbook; the first one where none is named.

    Raises FileError for a table that cannot be used, or with fewer than three feeds.
    """
    t = read_table(table, process, sheet)
    if (found := len(np.unique(t.feeds))) < 3:
        raise FileError(
            f"expected forces at 3 or more feeds per tooth that differ by 1 % or more, found {found}: the edge coefficients "
            "are what does not change with the feed", file=t.file, key="feed_per_tooth_mm",
        )  # fmt: skip
    straight = fit(STRAIGHT, t)
    runout = runout_of(t, straight)
    if runout is not None:  # with the coefficients of teeth that leave the cut
        runout = runout_of(t, fit(RUNOUT, t, np.array([runout.offset])))
    known = None if runout is None else np.array([runout.offset])
    models = [STRAIGHT, *([KIENZLE] if found > 3 else []), *([RUNOUT] if found > 3 and runout else [])]
    fitted = [replace(fit(m, t, known), left_out=_left_out(m, t, known)) for m in models]
    scale = np.min([f.sigma for f in fitted], axis=0)
    numbers = straight.numbers
    return IdentifiedLaw(
        {n: v[:2] for n, v in numbers.items()},
        {n: v[2:] for n, v in numbers.items()},
        straight.residual,
        fitted[0].left_out,
        tuple(sorted(fitted, key=lambda f: float(((f.left_out / scale) ** 2).sum()))),
        _bend(straight, fit(BEND, t)) if found > 3 else 1.0,
        runout,
        t,
    )


def _left_out(model: Model, t: ForceTable, known: Floats | None) -> Floats:
    out = np.full_like(t.force, np.nan)
    for c in np.unique(t.feeds):
        law = fit(model, t.rows(t.feeds != c), known)
        for i in np.flatnonzero(t.feeds == c):
            out[i] = t.force[i] - law.predict(t.cuts[i])
    return out


def _bend(straight: Fitted, bent: Fitted) -> float:
    """F test of three squares of the feed against the straight law, each axis in its own scatter."""
    free = len(straight.residual) - 3
    a, b = (straight.residual**2).sum(axis=0), (bent.residual**2).sum(axis=0)
    each = fisher.sf((a - b) / np.maximum(b / free, 1e-18), 1, free)
    return float(chi2.sf(-2 * np.log(np.maximum(each, 1e-300)).sum(), 6))  # Fisher's sum over the three axes

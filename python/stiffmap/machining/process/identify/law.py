"""From a table of forces to a law: values with intervals, lack of fit, what explains it, a feed left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as fisher
from scipy.stats import t as student

from stiffmap.common.broadcasting import Floats
from stiffmap.common.number_text import with_uncertainty
from stiffmap.common.short import short_repr
from stiffmap.machining.process.description import EndMill, Process
from stiffmap.machining.process.identify.models import MODELS, NAMES, Fitted, fit, power_basis, straight_basis
from stiffmap.machining.process.identify.runout import Runout, runout_of
from stiffmap.machining.process.identify.table import ForceTable, need, read_table

SIGNIFICANT = 0.01
"""Probability by chance below which a bend is stated."""
RIVAL = 4.0
"""Difference of the criterion within which another explanation stays a rival."""


@short_repr
@dataclass(frozen=True, eq=False)
class IdentifiedLaw:
    """A law of the cutting force, SI, from n mean forces."""

    coefficients: dict[str, tuple[float, float]]
    """Of the straight law: name -> (value, standard uncertainty), Ktc … in N/m², Kte … in N/m."""
    interval: dict[str, tuple[float, float]]
    """Name -> ends of the 95 % interval (Student, the axes apart)."""
    residual: Floats
    """(n, 3) N, measured less fitted."""
    left_out: Floats
    """(n, 3) N: measured less predicted by the law fitted without that cut's feed; NaN where the others are too few."""
    explanations: tuple[Fitted, ...]
    """Laws by the criterion of Akaike, the likeliest first."""
    bend: float
    """Probability that a straight law with this scatter bends as much by chance."""
    runout: Runout | None
    table: ForceTable

    @property
    def rms(self) -> Floats:
        """(3,) N, of the residual of each axis."""
        return np.asarray(np.sqrt((self.residual**2).mean(axis=0)))

    @property
    def bent(self) -> bool:
        """Whether the straight law is refused."""
        return self.bend < SIGNIFICANT

    @property
    def best(self) -> Fitted:
        """The likeliest law; where the forces bend, of those that do."""
        return next(e for e in self.explanations if not self.bent or e.model.name != "straight")

    def process(self, base: Process) -> Process:
        """The process with this law; a law that bends is taken by its secant at the chip of that process."""
        law, note = EndMill(**{n: v for n, (v, _) in self.coefficients.items()}), ""
        if self.bent and self.best.model.name == "Kienzle":
            bent, straight = power_basis(base, self.best.parameter), straight_basis(base)[:, ::2]
            same = (bent * straight).sum(axis=0) / (straight**2).sum(
                axis=0
            )  # the same mean force at this feed
            law = EndMill(*(float(v) for v in self.best.values * same))
            note = f"the law that bends is taken by its secant at {1e3 * base.chip:.4g} mm per tooth"
        tool = base.tool if self.runout is None else replace(base.tool, runout=self.runout.offset)
        u = {n: u for n, (_, u) in self.coefficients.items()}
        return replace(base, law=law, tool=tool, note=note, uncertainty=u)

    def words(self) -> list[str]:
        """What a workshop reads, one sentence each."""
        out = [
            f"{n} = {with_uncertainty(v / 1e6, u / 1e6)} N/mm²"
            if n.endswith("c")
            else f"{n} = {with_uncertainty(v / 1e3, u / 1e3)} N/mm"
            for n, (v, u) in self.coefficients.items()
        ]
        r = self.rms
        out.append(f"The straight law leaves {r[0]:.1f}, {r[1]:.1f}, {r[2]:.1f} N rms in x, y, z.")
        far = np.abs(self.left_out)
        if np.isfinite(far).any():
            w = np.nanmax(far, axis=0)
            out.append(f"It misses a feed left out by up to {w[0]:.0f}, {w[1]:.0f}, {w[2]:.0f} N.")
        if self.bent:
            best = self.best
            close = [
                e.model.name
                for e in self.explanations
                if e is not best and e.model.name != "straight" and e.score() - best.score() < RIVAL
            ]
            named = ", ".join(
                f"{n} {v:.3g}" for n, v in zip(best.model.parameters, best.parameter, strict=True)
            )
            named = f" ({named})" if named else ""
            out.append(
                f"The forces bend: a straight law would by chance with probability {self.bend:.2g} only. Likeliest: {best.model.name}{named}, "
                f"{best.model.words}; it leaves {', '.join(f'{v:.1f}' for v in np.sqrt((best.residual**2).mean(axis=0)))} N."
                + (f" These readings cannot separate it from: {', '.join(close)}." if close else "")
            )
        else:
            out.append(f"No bend is shown (probability {self.bend:.2g} by chance).")
        if self.runout is not None:
            out.append(
                f"Run-out of {1e6 * self.runout.offset:.3g} µm explains the line at the spindle's frequency."
            )
        return out + list(self.table.notes)


def identify_process(
    table: str | PathLike[str] | Mapping[str, Any], process: Process | None = None
) -> IdentifiedLaw:
    """Coefficients of the mechanistic law from a dynamometer's table: means per feed, or signals over time.

    table
        CSV file or columns ``feed_per_tooth_mm, Fx_N, Fy_N, Fz_N, teeth, axial_mm`` and, where the cut is no slot,
        ``side, radial_mm, diameter_mm``; signals also ``time_s, spindle_rpm``. Single values stand for all rows.
    process
        Gives tool, cut and speed where no column does.

    Raises FileError for a table that cannot be used, StiffmapError where there are fewer than three feeds.
    """
    t = read_table(table, process)
    need(t, 3)
    fitted = [fit(m, t) for m in MODELS if _fits(m.name, t)]
    straight = next(f for f in fitted if f.model.name == "straight")
    u = np.sqrt(np.diag(straight.covariance))
    reach = float(student.ppf(0.975, max(len(t.cuts) - 2, 1)))
    values = {n: (float(v), float(s)) for n, v, s in zip(NAMES, straight.values, u, strict=True)}
    law = EndMill(**{n: v for n, (v, _) in values.items()})
    return IdentifiedLaw(
        values,
        {n: (v - reach * s, v + reach * s) for n, (v, s) in values.items()},
        straight.residual,
        _left_out(t),
        tuple(sorted(fitted, key=lambda f: f.score())),
        _bend(straight, next((f for f in fitted if f.model.name == "bend"), None)),
        runout_of(t, law),
        t,
    )


def _fits(name: str, t: ForceTable) -> bool:
    """Whether the table can hold the parameters of a law."""
    feeds = len(np.unique(np.round(t.chip, 12)))
    if name == "run-out":
        return feeds > 3 and all(p.tool.teeth > 1 for p in t.cuts)
    return name == "straight" or feeds > 3


def _left_out(t: ForceTable) -> Floats:
    out = np.full_like(t.force, np.nan)
    feeds = np.round(t.chip, 12)
    if len(np.unique(feeds)) < 3:
        return out
    for c in np.unique(feeds):
        known = fit(MODELS[0], t.rows(feeds != c))
        for i in np.flatnonzero(feeds == c):
            out[i] = t.force[i] - straight_basis(t.cuts[i]) @ known.values
    return out


def _bend(straight: Fitted, bent: Fitted | None) -> float:
    """F test of three squares of the feed against the straight law, each axis in its own scatter."""
    if bent is None:
        return 1.0
    n = len(straight.residual)
    free = n - 3
    if free < 1:
        return 1.0
    a, b = (straight.residual**2).sum(axis=0), (bent.residual**2).sum(axis=0)
    each = fisher.sf((a - b) / np.maximum(b / free, 1e-18), 1, free)
    return float(chi2.sf(-2 * np.log(np.maximum(each, 1e-300)).sum(), 6))  # Fisher's sum over the three axes

"""From a table of forces to a law: values with intervals, its rivals by feeds left out, and which of them the readings refuse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import pi
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.special import chdtrc, fdtrc

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.number_text import with_uncertainty
from stiffmap.common.outputs import write_text
from stiffmap.common.short import short_repr
from stiffmap.common.yaml_text import text_of
from stiffmap.machining.process.description import EndMill, Process
from stiffmap.machining.process.identify.models import (
    BEND,
    KIENZLE,
    RUNOUT,
    STRAIGHT,
    Fitted,
    ForceModel,
    Number,
    Runout,
    fit,
    runout_of,
)
from stiffmap.machining.process.identify.table import COLUMNS, ForceColumns, ForceTable, read_table
from stiffmap.machining.process.load import load_process

SIGNIFICANT = 0.01
"""Probability by chance below which a bend is stated."""
APART = 0.02
"""Probability by chance below which the held-out errors of two laws are distinguished."""
MATERIALS, DULLEST = (1e7, 2e10), 2e-4
"""N/m², chip pressures from plastics to hard metals; m, edge forces by it: worn edges have half of that."""

UNITS = {"e": (1e3, " N/mm"), **dict.fromkeys("ctra", (1e6, " N/mm²"))}
"""SI size and unit by the last letter of a coefficient."""


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
    """Laws by their error at feeds that were left out, the least first."""
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
        """The law with the least error at feeds left out; where the forces bend, of those that do."""
        return next(e for e in self.explanations if not self.bent or e.model.name != "straight")

    def chance(self, other: Fitted) -> float:
        """Probability that a law as good as the best one errs by so much more (Wilcoxon's signed ranks of all readings left
        out; of the straight law that of its bend where it is smaller)."""
        scale = np.min([e.sigma for e in self.explanations], axis=0)
        more = ((np.abs(other.left_out) - np.abs(self.best.left_out)) / scale).ravel()
        if other is self.best or not np.isfinite(more).all() or not more.any():
            return 1.0
        from scipy.stats import wilcoxon

        p = float(wilcoxon(more).pvalue)
        return min(p, self.bend) if other.model.name == "straight" and self.bent else p

    @property
    def alike(self) -> tuple[Fitted, ...]:
        """The best law, and those that these readings cannot distinguish from it."""
        return tuple(e for e in self.explanations if e is self.best or self.chance(e) >= APART)

    @property
    def used(self) -> Fitted:
        """The law of `process`: the straight one where it is among those alike, or the best one."""
        return next((e for e in self.alike if e.model.name == "straight"), self.best)

    def process(self, base: Process | None = None) -> Process:
        """The process with the law `used`; a law that bends is taken by its secant at the chip of that process.

        base: tool, speeds and cut; None: those of the table's feed in the middle, with a diameter and a speed of the spindle
        from it. Raises StiffmapError where it has none.
        """
        base = self._middle() if base is None else base
        numbers = self.used.end_mill(base)
        law, note = EndMill(**{n: v for n, (v, *_) in numbers.items()}), ""
        if self.used.model.exponents:
            note = f"the law that bends is taken by its secant at {1e3 * base.chip:.4g} mm per tooth"
        shown = self.runout is not None and self.runout.interval[0] > 0
        tool = replace(base.tool, runout=self.runout.offset) if self.runout and shown else base.tool
        u = {n: u for n, (_, u, *_) in numbers.items() if u > 0}
        return replace(base, law=law, tool=tool, note=note, uncertainty=u)

    def _middle(self) -> Process:
        if missing := [COLUMNS[n][0] for n in ("diameter", "spindle") if n not in self.table.given]:
            what = f"missing column '{missing[0]}', which a process needs; give it, or a process with tool and speeds"
            raise FileError(what, file=self.table.file)
        return self.table.cuts[int(np.argsort(self.table.chip)[len(self.table.cuts) // 2])]

    def save(self, path: str | PathLike[str], base: Process | None = None) -> Path:
        """Write `process` as a file that `load_process` reads: source, uncertainties, intervals. Raises FileError."""
        p, numbers = self.process(base), self.used.end_mill(self._middle() if base is None else base)
        says = " ".join(self.verdict())
        here = f" Here {p.note}." if p.note else ""
        source = f"fitted to the forces of {Path(self.table.file).name}. {says}{here}"
        data = _keys(replace(p, name=Path(path).stem, source=source), numbers)
        try:
            load_process(data)
        except FileError as error:
            what = f"no process file can be written: {error.key}: {error.reason}"
            raise FileError(what, file=str(path)) from error
        return write_text(path, text_of(data))

    def words(self) -> list[str]:
        """What a workshop reads, one sentence each."""
        out = [
            f"{n} = {with_uncertainty(v / size, u / size)}{unit}, 95 %: {low / size:.4g} to {high / size:.4g}"
            for e in sorted(self.explanations, key=lambda e: e is not self.used)
            if e is self.used or e.model.name == "straight"
            for n, (v, u, low, high) in e.numbers.items()
            for size, unit in [UNITS.get(n[-1] if n[0] == "K" else "", (1.0, ""))]
        ]
        out.append(f"The straight law leaves {listed(self.residual)} N rms in x, y, z.")
        shown = (
            "The forces bend: a straight law would" if self.bent else "No bend is shown: a straight law would"
        )
        out.append(f"{shown} by chance with probability {self.bend:.2g}.")
        return [*out, *self.verdict(), *self.table.notes]

    def verdict(self) -> list[str]:
        """Which law predicts forces that it has not seen, by how much, whether the readings can distinguish them, and run-out."""
        best = self.best
        named = ", ".join(f"{n} {v:.3g}" for n, v in zip(best.model.exponents, best.parameter, strict=False))
        out = [
            f"Best at feeds left out: {best.model.name}{f' ({named})' if named else ''}, {best.model.words}; it misses them by "
            f"{listed(best.left_out)} N rms in x, y, z."
        ]
        for e in self.explanations:
            if e is not best:
                apart = "and cannot be distinguished" if e in self.alike else "worse"
                out.append(
                    f"The law {e.model.name} misses them by {listed(e.left_out)} N, {apart} "
                    f"(probability {self.chance(e):.2g} by chance)."
                )
        if len(self.explanations) < 2:
            out.append("Laws other than the straight one need forces at four feeds or more.")
        if self.runout is not None:
            low, high = (1e6 * v for v in self.runout.interval)
            what = "explains the line at the spindle's frequency" if low > 0 else "none is shown"
            out.append(
                f"Run-out of {1e6 * self.runout.offset:.3g} µm, 95 %: {low:.3g} to {high:.3g}: {what}."
            )
        return out

    def to_dict(self) -> dict[str, object]:
        """Data of the answer, SI; a number is its value, standard uncertainty and both ends of its 95 % interval."""
        laws = [
            {
                "name": e.model.name, "numbers": e.numbers, "left_out_rms": rms(e.left_out),
                "residual_rms": rms(e.residual), "chance": self.chance(e),
            }
            for e in self.explanations
        ]  # fmt: skip
        return {
            "table": self.table.file, "best": self.best.model.name, "used": self.used.model.name,
            "alike": [e.model.name for e in self.alike], "bend": self.bend, "laws": laws,
            "runout": self.runout and {"offset": self.runout.offset, "interval": self.runout.interval},
            "notes": self.table.notes,
        }  # fmt: skip


def rms(error: Floats) -> list[float]:
    """N of each axis."""
    return [float(v) for v in np.sqrt((error**2).mean(axis=0))]


def listed(error: Floats) -> str:
    """The same in words."""
    return ", ".join(f"{v:.1f}" for v in rms(error))


def _keys(p: Process, numbers: Mapping[str, Number]) -> dict[str, object]:
    """The keys of a process file with a law of chips and edges, whose `numbers` are SI, by name."""
    t, c, law = p.tool, p.cut, {}
    assert isinstance(p.law, EndMill)
    for n, (v, u, low, high) in numbers.items():
        size, unit = (1e6, "N/mm2") if n.endswith("c") else (1e3, "N/mm")
        law[n] = {"value": f"{v / size:.6g} {unit}"}
        if u > 0:
            note = f"95 % interval {low / size:.4g} to {high / size:.4g} {unit}"
            law[n] |= {"u": f"{u / size:.3g} {unit}", "note": note}
    helix = f"{t.helix * 180 / pi:.10g} deg"
    tool: dict[str, object] = {"diameter": _mm(t.diameter), "teeth": t.teeth, "helix": helix}
    if t.runout:
        angle = f"{t.runout_angle * 180 / pi:.10g} deg"
        tool["runout"] = {"offset": f"{1e6 * t.runout:.4g} um", "angle": angle}
    if t.stick_out:
        tool["stick_out"] = _mm(t.stick_out)
    if t.modulus:
        tool["modulus"] = f"{t.modulus / 1e9:.10g} GPa"
    radial = {} if c.side == "slot" else {"radial": _mm(c.radial)}
    return {
        "name": p.name, **({"title": p.title} if p.title else {}), "source": p.source, "tool": tool,
        "spindle": f"{p.spindle * 30 / pi:.10g} rpm", "feed": f"{60e3 * p.feed:.10g} mm/min",
        "cut": {"side": c.side, **radial, "axial": _mm(c.axial), "through": c.through}, "law": {"end_mill": law},
        **({} if p.tolerance is None else {"tolerance": _mm(p.tolerance)}),
    }  # fmt: skip


def _mm(value: float) -> str:
    return f"{1e3 * value:.10g} mm"


def identify_process(
    table: ForceColumns, process: Process | None = None, sheet: str | None = None
) -> IdentifiedLaw:
    """Coefficients of the mechanistic law from a dynamometer's table: means per feed, or signals over time.

    table
        CSV file, workbook, mapping or data frame of columns ``feed_per_tooth_mm, Fx_N, Fy_N, Fz_N, teeth, axial_mm`` and, where the cut is no slot,
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
    t = replace(t, notes=(*t.notes, *_doubts(straight.numbers)))
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


def _doubts(numbers: Mapping[str, Number]) -> Iterator[str]:
    """Of coefficients that no material, or hardly one, has."""
    least, most = ({n: v[k] for n, v in numbers.items()} for k in (2, 3))  # the ends of their intervals
    if most["Ktc"] < 0:
        yield "Ktc is below zero, which no tool has: the forces are to be those on the tool, along the feed, to its left (seen against the tool) and from holder to tip; those on the part have the other signs"
    elif most["Krc"] < 0 or max(least["Krc"], least["Kac"]) > most["Ktc"]:
        yield "Krc is below zero, or Krc or Kac above Ktc, which is rare: is the side right, and are Fx, Fy and Fz, with their signs?"
    if most["Ktc"] > 0 and (most["Ktc"] < MATERIALS[0] or least["Ktc"] > MATERIALS[1]):
        yield "Ktc is not within 10 to 20000 N/mm², from plastics to hard metals: are all columns in the units of their headers?"
    if any(most[n] < 0 or least[n] > DULLEST * abs(most["Ktc"]) for n in ("Kte", "Kre", "Kae")):
        yield "An edge coefficient is below zero or too large for an edge: an offset of a channel goes into it; subtract an air cut's mean"


def _left_out(model: ForceModel, t: ForceTable, known: Floats | None) -> Floats:
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
    each = fdtrc(1, free, np.maximum(a - b, 0.0) / np.maximum(b / free, 1e-18))
    return float(chdtrc(6, -2 * np.log(np.maximum(each, 1e-300)).sum()))  # Fisher's sum over the three axes

"""The answer of a calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from stiffmap.common.json_text import json_text, plain
from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.common.short import short_repr
from stiffmap.common.units import DISPLAY_UNITS
from stiffmap.experiment.comparison.residual import Summary
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.outliers import set_aside
from stiffmap.experiment.noise.over_time import OverTime
from stiffmap.identification.inference.machines import HeldOut
from stiffmap.identification.inference.shares import WideGroup, largest
from stiffmap.identification.inference.travel import Profile
from stiffmap.identification.inference.verdict import not_as_stated
from stiffmap.solve.machine import Machine
from stiffmap.solve.validity import Validity

APART = ("rows", "beyond", "shares", "profiles", "failed", "validity")
"""Fields that JSON has in another form, behind all others."""
MOST = 6
"""Parts that a line names."""
SHOWN = DISPLAY_UNITS | {"1": (1e6, "ppm")}
FACTOR = 0.5
"""Logarithm of a factor from which it is written as one: ×1.65."""


@dataclass(frozen=True)
class FoundNumber:
    """A declared number as the readings have it, SI: its standard uncertainty before and after them, and whether they determine it."""

    name: str
    group: str
    leg: str
    unit: str
    """``m``, ``rad``, ``1`` or ``ln`` (logarithm of a factor)."""
    value: float
    """What it is off by: posterior mean."""
    u: float
    """Declared standard uncertainty."""
    sigma: float
    """Posterior standard deviation."""
    pull: float
    """Value over the standard deviation that it should have if `u` is right."""
    identifiable: bool
    """Whether the readings say more of it than its prior does."""
    observability: float
    """How many times the readings sharpen its prior."""
    minimal: bool
    """Whether it belongs to the minimal set that spans all that the readings determine."""
    share: float
    """Of the squares of the readings' difference from the declared machine."""

    def __str__(self) -> str:
        off = measured(self.value, self.sigma, self.unit)
        return f"{self.name}: {off} off ({abs(self.value) / self.u:.2g} standard uncertainties)"


@short_repr
@dataclass(frozen=True, eq=False)
class Calibration:
    """What a machine's numbers are, given their uncertainties and the readings; SI."""

    verdict: str
    """``as declared``, ``adjusted within tolerance``, ``adjusted beyond tolerance``, ``beyond tolerance: NAME, ...`` or
    ``unattributed``."""
    rank: int
    """Directions that the readings determine, of `len(rows)`."""
    which: str
    """What `machine` is: ``calibrated``, or ``declared`` where that predicts as well."""
    before: Summary
    """The declared machine on all readings."""
    after: Summary
    """`machine` on all readings."""
    noise: float
    """Noise floor, m (NaN where only angles are read)."""
    scale: float
    """Noise of the readings over the floor."""
    rest: str
    """What is left that nobody can name; empty: nothing."""
    outliers: tuple[str, ...]
    """Rows that stand alone."""
    swapped: tuple[tuple[str, str], ...]
    """Pairs of them that fit where each has the reading of the other."""
    stopped: bool
    """Whether the time budget ended it early: the answer is the best so far."""
    seconds: float
    promise: tuple[float, float] | None
    """By how much a reading of another pose will differ from `machine`, m or rad, and its standard uncertainty."""
    held_out: HeldOut | None
    """Both on readings that no fit saw; None where there are not two folds, or time was over."""
    over_time: OverTime | None
    """What `machine` leaves over time; None where no times were recorded."""
    rows: tuple[FoundNumber, ...]
    beyond: tuple[FoundNumber, ...]
    """Numbers that no tolerance allows."""
    wide: tuple[WideGroup, ...]
    """Groups whose numbers are further off than their standard uncertainties say, where that is beyond doubt."""
    shares: Mapping[str, float]
    """How the squares of the readings' difference from the declared machine are shared out."""
    profiles: tuple[Profile, ...]
    """Errors along the drives' travel, which `machine` has."""
    failed: tuple[tuple[str, str], ...]
    """Unknowns that the machine cannot be built or solved with, and why."""
    machine: Machine = field(repr=False)
    """The machine that is handed over; its controller keeps the declared numbers."""
    validity: Validity
    """What the readings covered; beyond it nothing vouches for `machine`."""
    experiment: Experiment = field(repr=False)
    residual: Floats = field(repr=False)
    """(n, c) reading minus prediction of `machine`, less fitted frames and zeros; NaN of outliers."""

    def lines(self) -> list[str]:
        """The verdict in a few lines."""
        unit = self.before.size[1]

        def size(s: Summary) -> str:
            return in_display_units(s.size[0], unit)

        out = [f"calibration: {self.verdict}{' (stopped early)' if self.stopped else ''}"]
        out += [f"  {b}" for b in self.beyond]
        out += not_as_stated(self.scale)
        out += map(str, self.wide)
        out.append(f"identifiable from the readings: {self.rank} directions of {len(self.rows)} unknowns")
        out.append(f"shares of the squares: {'; '.join(largest(self.shares, MOST))}")
        noise = "" if math.isnan(self.noise) else f" (noise {in_display_units(self.noise, 'm')})"
        out.append(f"misfit: rms {size(self.before)} as declared, {size(self.after)} {self.which}{noise}")
        if self.held_out:
            h = self.held_out
            out.append(
                f"machine file on {h.by} that no fit saw: rms {size(h.before)} as declared, {size(h.after)} {self.which}"
            )
        if self.promise:
            out.append(f"machine file promises {measured(*self.promise, unit)} at other poses")
        out.append(f"holds where it was read: {self.validity}")
        if self.over_time is not None:
            out.append(str(self.over_time))
        out += [f"left out: {text}" for text in self.experiment.out_of_reach]
        if self.rest:
            out.append(f"left: {self.rest}")
        return out + set_aside(self.outliers, self.swapped)

    def table(self, most: int | None = None) -> list[str]:
        """The unknowns, one a line, those first that the readings determine best: name, value, u, posterior sigma, pull, observability."""
        width = max((len(r.name) for r in self.rows), default=4)
        out = [
            f"{'unknown':{width}}  {'value':>12}  {'u':>11}  {'sigma':>11}  {'pull':>6}  {'observable':>10}  identifiable"
        ]
        for r in sorted(self.rows, key=lambda r: -r.observability)[:most]:
            found = ("minimal" if r.minimal else "yes") if r.identifiable else "no"
            value, u, sigma = (in_display_units(v, r.unit) for v in (r.value, r.u, r.sigma))
            out.append(
                f"{r.name:{width}}  {value:>12}  {u:>11}  {sigma:>11}  {r.pull:6.1f}  {r.observability:10.1f}  {found}"
            )
        return out

    def to_json(self) -> str:
        """All but arrays and machines, SI; NaN is null."""
        return json_text(self.as_plain())

    def as_plain(self) -> dict[str, Any]:
        """JSON data."""
        out = {f.name: plain(getattr(self, f.name)) for f in fields(self) if f.repr and f.name not in APART}
        known = ("poses", "drives", "loads", "temperature")
        out["validity"] = plain({name: getattr(self.validity, name) for name in known})
        out["shares"] = [{"part": name, "share": share} for name, share in self.shares.items()]
        out["beyond"], out["table"] = plain(self.beyond), plain(self.rows)
        out["travel"] = plain(self.profiles)
        out["failed"] = [list(f) for f in self.failed]
        out["left_out"] = list(self.experiment.out_of_reach)
        return out

    def __str__(self) -> str:
        return "\n".join(self.lines())


def in_display_units(value: float, unit: str) -> str:
    """A number in the units of the screen; the logarithm of a factor as the per cent that it adds, or as the factor."""
    if unit == "ln":
        return f"{100.0 * math.expm1(value):.4g} %" if abs(value) < FACTOR else f"×{math.exp(value):.4g}"
    factor, name = SHOWN[unit]
    return f"{value * factor:.4g} {name}"


def measured(value: float, u: float, unit: str) -> str:
    """``0.0520 ± 0.0009 mm``; of the logarithm of a factor in per cent, or as the factor with its relative uncertainty."""
    if unit == "ln":
        if abs(value) < FACTOR:
            return f"{with_uncertainty(100.0 * math.expm1(value), 100.0 * math.exp(value) * u)} %"
        return f"×{within(math.exp(value), math.exp(value) * u)} ± {within(100.0 * u, 100.0 * u)} %"
    factor, name = SHOWN[unit]
    return f"{with_uncertainty(factor * value, factor * u)} {name}"

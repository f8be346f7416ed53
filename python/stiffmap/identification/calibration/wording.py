"""A calibration in plain lines, in mm, mrad, ppm and per cent."""

from __future__ import annotations

import math

from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.identification.calibration.facts import Beyond, Facts, Wider

DISPLAY_UNITS = {"m": (1e3, "mm"), "rad": (1e3, "mrad"), "1": (1e6, "ppm")}
FACTOR = 0.5
"""Logarithm of a factor from which it is written as one: ×1.65."""

LARGEST = 3
"""Large pulls that a line names."""
NAMED = 12
"""Outliers that a line names."""


def in_display_units(value: float, unit: str) -> str:
    """A number in the units of the screen; the logarithm of a factor as the per cent that it adds, or as the factor."""
    if unit == "ln":
        return f"{100.0 * math.expm1(value):.4g} %" if abs(value) < FACTOR else f"×{math.exp(value):.4g}"
    factor, name = DISPLAY_UNITS[unit]
    return f"{value * factor:.4g} {name}"


def measured(value: float, u: float, unit: str) -> str:
    """``0.0520 ± 0.0009 mm``; of the logarithm of a factor in per cent, or as the factor with its relative uncertainty."""
    if unit == "ln":
        if abs(value) < FACTOR:
            return f"{with_uncertainty(100.0 * math.expm1(value), 100.0 * math.exp(value) * u)} %"
        return f"×{within(math.exp(value), math.exp(value) * u)} ± {within(100.0 * u, 100.0 * u)} %"
    factor, name = DISPLAY_UNITS[unit]
    return f"{with_uncertainty(factor * value, factor * u)} {name}"


def lines(c: Facts) -> list[str]:
    """Verdict, groups, misfit before and after, what is left."""
    out = [f"calibration: {c.verdict}{' (stopped early)' if c.stopped else ''}"]
    out += [f"  {_beyond(b)}" for b in c.beyond]
    out += [f"  {_wider(w)}" for w in c.wider]
    out += [f"  refused: {r}" for r in c.refused]
    out += _large_pulls(c)
    out.append(f"identifiable from the readings: {c.rank} directions of {len(c.rows)} unknowns")
    out.append("groups: " + _groups(c))
    out.append(
        f"misfit: rms {in_display_units(c.rms_before, c.unit)} as declared, {in_display_units(c.rms_after, c.unit)} calibrated; "
        f"{100 * c.explained:.1f} % explained (noise {in_display_units(c.noise, c.unit)})"
    )
    if c.held_out:
        h = c.held_out
        out.append(
            f"held-out {h.by}: rms {in_display_units(h.before, c.unit)} as declared, {in_display_units(h.after, c.unit)} with all "
            f"unknowns, {in_display_units(h.chosen, c.unit)} with the chosen groups"
        )
    if c.unseen:
        f = c.unseen
        out.append(
            f"machine file on {f.by} that no fit saw: rms {in_display_units(f.before, c.unit)} as declared, "
            f"{measured(f.after, f.u, c.unit)} corrected"
        )
        if f.after > f.before:
            out.append(
                "the file is worse than the declared machine on readings that no fit saw: do not use it; more poses are needed"
            )
    out.append(f"holds where it was read: {c.validity}")
    if c.over_time is not None:
        out.append(str(c.over_time))
    if c.floor > 0.0:
        where = ", ".join(f"{k} {in_display_units(v, _unit(k, c.unit))}" for k, v in c.rest.items())
        out.append(
            f"model-form floor: {in_display_units(c.floor, c.unit)} per pose beyond noise; left: {where}"
        )
    if c.travel:
        t = c.travel
        alone = ", ".join(
            f"{p.drive} {100 * p.share:.0f} %" for p in sorted(t.profiles, key=lambda p: -p.share)[:4]
        )
        out.append(
            f"left along the drives' travel: {100 * t.share:.0f} % of its squares on held-out {t.by}, "
            f"{in_display_units(t.before, c.unit)} to {in_display_units(t.after, c.unit)} with a profile of each drive; alone {alone}"
        )
    if c.outliers:
        more = f" and {len(c.outliers) - NAMED} more" if len(c.outliers) > NAMED else ""
        plural = "s" if len(c.outliers) > 1 else ""
        out.append(f"set aside as outlier{plural}: row{plural} {', '.join(c.outliers[:NAMED])}{more}")
    return out


def _large_pulls(c: Facts) -> list[str]:
    """Which numbers are farther off than their standard uncertainties allow."""
    far = c.pulls
    if far.within:
        return []
    of = {r.name: r for r in c.rows}
    some = [f"{n} {in_display_units(of[n].value, of[n].unit)} (pull {v:.1f})" for n, v in far.large[:LARGEST]]
    more = f" and {len(far.large) - LARGEST} more" if len(far.large) > LARGEST else ""
    told = f": {', '.join(some)}{more}" if some else ""
    return [
        f"large pulls: the numbers are {far.rms:.2g} times as far off (rms) as their standard uncertainties say{told}; "
        f"give the uncertainties that this machine has (u in its file), or --tolerance {far.factor:g}"
    ]


def _unit(name: str, unit: str) -> str:
    return "rad" if name.startswith("r") else unit


def odds(nats: float) -> str:
    """How much likelier the readings are with something than without it, from the logarithm: ``20:1``, ``1e12:1``."""
    power = nats / 2.302585092994046
    if abs(power) > 3:
        return f"1e{power:.0f}:1" if power > 0 else f"1:1e{-power:.0f}"
    return f"{10**power:.2g}:1" if power >= 0 else f"1:{10**-power:.2g}"


def _beyond(b: Beyond) -> str:
    other = f"; or instead: {', '.join(b.rivals[:3])}" if b.rivals else ""
    more = f" and {len(b.rivals) - 3} more" if len(b.rivals) > 3 else ""
    return f"{b.name}: {measured(b.value, b.sigma, b.unit)} (odds {odds(b.nats)}){other}{more}"


def _wider(w: Wider) -> str:
    other = f"; or instead: {', '.join(w.rivals)}" if w.rivals else ""
    return f"{w.group}: standard uncertainties {w.factor:g} times too small (odds {odds(w.nats)}){other}; the readings do not determine which of them"


def _groups(c: Facts) -> str:
    chosen = [g for g in c.groups.groups if g.name in c.groups.chosen]
    told = [
        f"{g.name}, odds {odds(g.alone)}" + (f" (or {', '.join(g.rivals)})" if g.rivals else "")
        for g in sorted(chosen, key=lambda g: -g.last)
    ]
    return "; ".join(told) or "none is demanded"


def table(c: Facts, most: int | None = None) -> list[str]:
    """Name, value, u, posterior sigma, pull, observability."""
    width = max((len(r.name) for r in c.rows), default=4)
    out = [
        f"{'unknown':{width}}  {'value':>12}  {'u':>11}  {'sigma':>11}  {'pull':>6}  {'u/sigma':>8}  identifiable"
    ]
    for r in sorted(c.rows, key=lambda r: -r.observability)[:most]:
        told = ("minimal" if r.minimal else "yes") if r.identifiable else "no"
        cells = (in_display_units(v, r.unit) for v in (r.value, r.u, r.sigma))
        value, u, sigma = cells
        out.append(
            f"{r.name:{width}}  {value:>12}  {u:>11}  {sigma:>11}  {r.pull:6.1f}  {r.observability:8.1f}  {told}"
        )
    return out

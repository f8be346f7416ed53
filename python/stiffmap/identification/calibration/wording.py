"""Numbers of a calibration in mm, mrad, ppm and per cent."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stiffmap.common.number_text import with_uncertainty, within
from stiffmap.identification.calibration.table import Row

DISPLAY_UNITS = {"m": (1e3, "mm"), "rad": (1e3, "mrad"), "1": (1e6, "ppm")}
FACTOR = 0.5
"""Logarithm of a factor from which it is written as one: ×1.65."""


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


def table(rows: Sequence[Row], most: int | None = None) -> list[str]:
    """Name, value, u, posterior sigma, pull, observability."""
    width = max((len(r.name) for r in rows), default=4)
    out = [
        f"{'unknown':{width}}  {'value':>12}  {'u':>11}  {'sigma':>11}  {'pull':>6}  {'observable':>10}  identifiable"
    ]
    for r in sorted(rows, key=lambda r: -r.observability)[:most]:
        found = ("minimal" if r.minimal else "yes") if r.identifiable else "no"
        value, u, sigma = (in_display_units(v, r.unit) for v in (r.value, r.u, r.sigma))
        out.append(
            f"{r.name:{width}}  {value:>12}  {u:>11}  {sigma:>11}  {r.pull:6.1f}  {r.observability:10.1f}  {found}"
        )
    return out
